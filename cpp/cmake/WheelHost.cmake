# SPDX-License-Identifier: Apache-2.0
#
# Fills oocpt_host for a wheel host: OpenUSD 25.08 or 26.03 under the namespace of the application it was taken from.

set(OOCPT_HOST_VERSION "25.08" CACHE STRING "OpenUSD of the wheel host: 25.08 or 26.03")
set_property(CACHE OOCPT_HOST_VERSION PROPERTY STRINGS 25.08 26.03)
if(OOCPT_HOST_VERSION STREQUAL "25.08")
    set(oocpt_python_version 3.11)
elseif(OOCPT_HOST_VERSION STREQUAL "26.03")
    set(oocpt_python_version 3.13)
else()
    message(FATAL_ERROR "OOCPT_HOST_VERSION is '${OOCPT_HOST_VERSION}'; cpp/abi describes 25.08 and 26.03")
endif()
string(REPLACE "." "" oocpt_abi_version "${OOCPT_HOST_VERSION}")
string(REPLACE "." "_" oocpt_runtime_version "${OOCPT_HOST_VERSION}")

if(DEFINED ENV{OOCPT_CACHE})
    set(oocpt_cache "$ENV{OOCPT_CACHE}")
else()
    set(oocpt_cache "$ENV{HOME}/.cache/oocpt")
endif()
set(OOCPT_HOST_ROOT "${oocpt_cache}/host-${OOCPT_HOST_VERSION}" CACHE PATH
    "Folder of the wheel host, as `cargo xtask` puts it together")
set(OOCPT_PYTHON_INCLUDE "" CACHE PATH "Folder of Python.h of CPython ${oocpt_python_version}")

set(oocpt_usd_library "${OOCPT_HOST_ROOT}/python/bpy/lib/libusd_ms.so")
foreach(needed "${oocpt_usd_library}" "${OOCPT_HOST_ROOT}/include/pxr/base/tf/token.h")
    if(NOT EXISTS "${needed}")
        message(FATAL_ERROR "No wheel host: ${needed} is missing. Run `cargo xtask build`, or set OOCPT_HOST_ROOT")
    endif()
endforeach()

if(NOT OOCPT_PYTHON_INCLUDE)
    find_package(Python3 ${oocpt_python_version} EXACT REQUIRED COMPONENTS Development.Module)
    set(OOCPT_PYTHON_INCLUDE "${Python3_INCLUDE_DIRS}")
endif()
find_path(OOCPT_TBB_INCLUDE tbb/concurrent_queue.h REQUIRED)

target_include_directories(oocpt_host INTERFACE ${CMAKE_CURRENT_SOURCE_DIR}/abi)
target_include_directories(oocpt_host SYSTEM INTERFACE
    ${OOCPT_HOST_ROOT}/include ${OOCPT_PYTHON_INCLUDE} ${OOCPT_TBB_INCLUDE})
target_compile_definitions(oocpt_host INTERFACE
    OOCPT_ABI_VERSION=${oocpt_abi_version}
    # The header wheels, of one version or of two (rust/xtask/src/host/wheels.rs), name namespaces of their own.
    pxrInternal_v0_25_8__pxrReserved__=pxrBlender_v${oocpt_runtime_version}__pxrReserved__
    pxrInternal_v0_26_8__pxrReserved__=pxrBlender_v${oocpt_runtime_version}__pxrReserved__
    # VtValue's table of functions has an entry for Python in this runtime.
    PXR_PYTHON_SUPPORT_ENABLED)
# <ext/hash_set>, which Tf uses, warns of being old in every file.
target_compile_options(oocpt_host INTERFACE -Wno-deprecated)
target_link_libraries(oocpt_host INTERFACE ${oocpt_usd_library})
# Its own dependencies (GL, X11) are the host's affair; and no RPATH, since the host has it loaded.
target_link_options(oocpt_host INTERFACE -Wl,--allow-shlib-undefined)
set(CMAKE_SKIP_RPATH ON)
