# SPDX-License-Identifier: Apache-2.0
#
# Fills oocpt_host for the wheel host: OpenUSD 25.08 under the namespace of the application it was taken from.

if(DEFINED ENV{OOCPT_CACHE})
    set(oocpt_cache "$ENV{OOCPT_CACHE}")
else()
    set(oocpt_cache "$ENV{HOME}/.cache/oocpt")
endif()
set(OOCPT_HOST_ROOT "${oocpt_cache}/host-25.08" CACHE PATH
    "Folder of the wheel host, as `cargo xtask` puts it together")
set(OOCPT_PYTHON_INCLUDE "" CACHE PATH "Folder of Python.h of CPython 3.11")

set(oocpt_usd_library "${OOCPT_HOST_ROOT}/python/bpy/lib/libusd_ms.so")
foreach(needed "${oocpt_usd_library}" "${OOCPT_HOST_ROOT}/include/pxr/base/tf/token.h")
    if(NOT EXISTS "${needed}")
        message(FATAL_ERROR "No wheel host: ${needed} is missing. Run `cargo xtask build`, or set OOCPT_HOST_ROOT")
    endif()
endforeach()

if(NOT OOCPT_PYTHON_INCLUDE)
    find_package(Python3 3.11 EXACT REQUIRED COMPONENTS Development.Module)
    set(OOCPT_PYTHON_INCLUDE "${Python3_INCLUDE_DIRS}")
endif()
find_path(OOCPT_TBB_INCLUDE tbb/concurrent_queue.h REQUIRED)

target_include_directories(oocpt_host INTERFACE ${CMAKE_CURRENT_SOURCE_DIR}/abi/25.08)
target_include_directories(oocpt_host SYSTEM INTERFACE
    ${OOCPT_HOST_ROOT}/include ${OOCPT_PYTHON_INCLUDE} ${OOCPT_TBB_INCLUDE})
target_compile_definitions(oocpt_host INTERFACE
    # The header wheels and the runtime differ in the name of the namespace and in nothing else.
    pxrInternal_v0_25_8__pxrReserved__=pxrBlender_v25_08__pxrReserved__
    # VtValue's table of functions has an entry for Python in this runtime.
    PXR_PYTHON_SUPPORT_ENABLED)
# <ext/hash_set>, which Tf uses, warns of being old in every file.
target_compile_options(oocpt_host INTERFACE -Wno-deprecated)
target_link_libraries(oocpt_host INTERFACE ${oocpt_usd_library})
# Its own dependencies (GL, X11) are the host's affair; and no RPATH, since the host has it loaded.
target_link_options(oocpt_host INTERFACE -Wl,--allow-shlib-undefined)
set(CMAKE_SKIP_RPATH ON)
