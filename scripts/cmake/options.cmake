# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
option(SEPARATRIX_MPI "Build with MPI and parallel HDF5 (OFF: one process, serial HDF5)" ON)
option(SEPARATRIX_TESTS "Build the tests" ON)
option(SEPARATRIX_GPU "Let maps run on NVIDIA GPUs as well (needs nvcc)" OFF)
option(SEPARATRIX_STATIC "Link HDF5, GSL and zlib statically, as wheels do" OFF)
option(SEPARATRIX_ISAL "Compress final files with ISA-L where it is installed" ON)
set(SEPARATRIX_LANES all CACHE STRING "Vector kernels: all (for any processor), or native (for this one; the build is shorter)")
set_property(CACHE SEPARATRIX_LANES PROPERTY STRINGS all native)
option(SEPARATRIX_FUZZ "Build the fuzzer of the readers (GCC)" OFF)

if(NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES)
  set(CMAKE_BUILD_TYPE Release CACHE STRING "Build type" FORCE)
endif()
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY "${CMAKE_BINARY_DIR}/bin")
set(CMAKE_LIBRARY_OUTPUT_DIRECTORY "${CMAKE_BINARY_DIR}/lib")
set(CMAKE_ARCHIVE_OUTPUT_DIRECTORY "${CMAKE_BINARY_DIR}/lib")
# Layers that need more or less optimisation state it in src/CMakeLists.txt.
set(CMAKE_Fortran_FLAGS_RELEASE "-O2" CACHE STRING "Fortran release flags" FORCE)
set(CMAKE_CXX_FLAGS_RELEASE "-O2 -DNDEBUG" CACHE STRING "C++ release flags" FORCE)
set(CMAKE_CXX_STANDARD 17)
set(CMAKE_C_STANDARD 11)

option(SEPARATRIX_WERROR "Treat warnings of the compilers as errors, as the tests do" OFF)

include(refuse_fast_math)

add_library(separatrix_strict INTERFACE)
target_compile_options(separatrix_strict INTERFACE
  -ffp-contract=off
  "$<$<COMPILE_LANGUAGE:Fortran>:-std=f2018;-fimplicit-none;-Wall;-Wextra;-Wno-compare-reals;-Wno-maybe-uninitialized;-Wno-uninitialized;-Werror=implicit-interface;-ffree-line-length-132>"
  # As in Fortran 2018, no local array is static, where threads would share it.
  "$<$<COMPILE_LANG_AND_ID:Fortran,GNU>:-frecursive>"
  "$<$<BOOL:${SEPARATRIX_WERROR}>:-Werror>"
  "$<$<COMPILE_LANGUAGE:C,CXX>:-Wall;-Wextra>"
  # Vectors are passed between functions that are always inlined.
  "$<$<COMPILE_LANGUAGE:CXX>:-Wno-psabi>"
  "$<$<AND:$<CONFIG:Debug>,$<COMPILE_LANGUAGE:Fortran>>:-fcheck=all,no-array-temps;-fbacktrace>")

# Where the processor can, GCC 12 makes a fused multiply-add of a complex product in straight-line code, in spite of
# -ffp-contract=off; results would depend on the processor that the build is for.
if(CMAKE_Fortran_FLAGS MATCHES "-m(arch|tune|fma|avx|cpu)")
  target_compile_options(separatrix_strict INTERFACE "$<$<COMPILE_LANGUAGE:Fortran>:-fno-tree-slp-vectorize>")
endif()
