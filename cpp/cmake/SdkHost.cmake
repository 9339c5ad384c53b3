# SPDX-License-Identifier: Apache-2.0
#
# Fills oocpt_host from an OpenUSD install: by its own CMake package, or, where it has none that works (applications
# that ship OpenUSD), by its headers and libraries.

set(OOCPT_USD_ROOT "" CACHE PATH "OpenUSD install: the folder that holds include/pxr/pxr.h")
if(NOT EXISTS "${OOCPT_USD_ROOT}/include/pxr/pxr.h")
    message(FATAL_ERROR "OOCPT_USD_ROOT is '${OOCPT_USD_ROOT}', which has no include/pxr/pxr.h")
endif()

# The libraries that the plugin names; the rest of OpenUSD comes along.
set(oocpt_usd_parts hd hdsi hf cameraUtil sdr sdf ar vt plug work gf tf arch)

list(PREPEND CMAKE_PREFIX_PATH "${OOCPT_USD_ROOT}")
find_package(pxr CONFIG QUIET PATHS "${OOCPT_USD_ROOT}" NO_DEFAULT_PATH)
if(pxr_FOUND)
    if(TARGET usd_ms)
        target_link_libraries(oocpt_host INTERFACE usd_ms)
    else()
        target_link_libraries(oocpt_host INTERFACE ${oocpt_usd_parts})
    endif()
    message(STATUS "OpenUSD ${PXR_VERSION} at ${OOCPT_USD_ROOT}, by its CMake package")
else()
    find_library(OOCPT_USD_MONOLITHIC NAMES usd_ms pxr_usd_ms PATHS "${OOCPT_USD_ROOT}" PATH_SUFFIXES lib dsolib
        NO_DEFAULT_PATH)
    if(OOCPT_USD_MONOLITHIC)
        target_link_libraries(oocpt_host INTERFACE ${OOCPT_USD_MONOLITHIC})
    else()
        foreach(part IN LISTS oocpt_usd_parts)
            find_library(OOCPT_USD_${part} NAMES usd_${part} pxr_${part} PATHS "${OOCPT_USD_ROOT}"
                PATH_SUFFIXES lib dsolib NO_DEFAULT_PATH REQUIRED)
            target_link_libraries(oocpt_host INTERFACE ${OOCPT_USD_${part}})
        endforeach()
    endif()
    target_include_directories(oocpt_host SYSTEM INTERFACE "${OOCPT_USD_ROOT}/include")
    target_link_options(oocpt_host INTERFACE -Wl,--allow-shlib-undefined)
    message(STATUS "OpenUSD at ${OOCPT_USD_ROOT}, by its headers and libraries")
endif()

find_path(OOCPT_TBB_INCLUDE NAMES tbb/concurrent_queue.h tbb/tbb.h HINTS "${OOCPT_USD_ROOT}/include" REQUIRED)
target_include_directories(oocpt_host SYSTEM INTERFACE ${OOCPT_TBB_INCLUDE})

# Headers of Python are needed only if this OpenUSD was built with it.
file(STRINGS "${OOCPT_USD_ROOT}/include/pxr/pxr.h" oocpt_pxr_lines)
string(REGEX MATCH "#if 1;#define PXR_PYTHON_SUPPORT_ENABLED" oocpt_usd_has_python "${oocpt_pxr_lines}")
if(oocpt_usd_has_python)
    set(OOCPT_PYTHON_INCLUDE "" CACHE PATH "Folder of Python.h of the Python that this OpenUSD was built with")
    if(NOT OOCPT_PYTHON_INCLUDE)
        find_package(Python3 REQUIRED COMPONENTS Development)
        set(OOCPT_PYTHON_INCLUDE "${Python3_INCLUDE_DIRS}")
    endif()
    target_include_directories(oocpt_host SYSTEM INTERFACE ${OOCPT_PYTHON_INCLUDE})
endif()
target_compile_options(oocpt_host INTERFACE -Wno-deprecated)
set(CMAKE_INSTALL_RPATH "${OOCPT_USD_ROOT}/lib")
