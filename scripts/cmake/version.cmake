# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
#
# separatrix_build_info: the Fortran module `build_info` with what `--version` prints. The commit is
# asked for at every build; the module is rewritten, and compiled again, only when something changed.
string(TOUPPER "${CMAKE_BUILD_TYPE}" build_type)
string(STRIP "${CMAKE_Fortran_FLAGS} ${CMAKE_Fortran_FLAGS_${build_type}} -ffp-contract=off" build_flags)
if(build_type STREQUAL "RELEASE")
  string(APPEND build_flags ", -O3 or -O0 by layer")
endif()
string(APPEND build_flags ", lanes ${SEPARATRIX_LANES}")
if(ISAL_LIBRARY AND SEPARATRIX_ISAL AND NOT SEPARATRIX_STATIC)
  string(APPEND build_flags ", ISA-L")
endif()
string(STRIP "${CMAKE_C_FLAGS} ${CMAKE_C_FLAGS_${build_type}} -ffp-contract=off" build_c_flags)
string(STRIP "${CMAKE_CXX_FLAGS} ${CMAKE_CXX_FLAGS_${build_type}} -ffp-contract=off" build_cxx_flags)
set(build_mpi "none")
set(build_debug .false.)
if(build_type STREQUAL "DEBUG")
  set(build_debug .true.)
endif()
set(build_hdf5 "${HDF5_VERSION} (serial)")
if(SEPARATRIX_MPI)
  string(REGEX REPLACE "[,\n].*" "" build_mpi "${MPI_C_LIBRARY_VERSION_STRING}")
  set(build_hdf5 "${HDF5_VERSION} (parallel)")
endif()

set(build_info "${CMAKE_BINARY_DIR}/generated/build_info.f90")
add_custom_target(separatrix_build_info_source
  COMMAND "${CMAKE_COMMAND}"
          "-DTEMPLATE=${CMAKE_CURRENT_LIST_DIR}/build_info.f90.in" "-DOUTPUT=${build_info}"
          "-DSOURCE_DIR=${PROJECT_SOURCE_DIR}" "-DVERSION=${PROJECT_VERSION}"
          "-DCOMPILER=Fortran ${CMAKE_Fortran_COMPILER_ID} ${CMAKE_Fortran_COMPILER_VERSION}, C ${CMAKE_C_COMPILER_ID} ${CMAKE_C_COMPILER_VERSION}, C++ ${CMAKE_CXX_COMPILER_ID} ${CMAKE_CXX_COMPILER_VERSION}"
          "-DFLAGS=${build_flags}" "-DC_FLAGS=C ${build_c_flags}, C++ ${build_cxx_flags}" "-DMPI=${build_mpi}" "-DHDF5=${build_hdf5}"
          "-DDEBUG=${build_debug}"
          -P "${CMAKE_CURRENT_LIST_DIR}/write_build_info.cmake"
  BYPRODUCTS "${build_info}"
  COMMENT "Asking for the commit" VERBATIM)

add_library(separatrix_build_info STATIC "${build_info}")
add_dependencies(separatrix_build_info separatrix_build_info_source)
set(build_info_modules "${CMAKE_BINARY_DIR}/modules/build_info")
set_target_properties(separatrix_build_info PROPERTIES
  Fortran_MODULE_DIRECTORY "${build_info_modules}" POSITION_INDEPENDENT_CODE ON)
target_include_directories(separatrix_build_info PUBLIC "${build_info_modules}")
target_link_libraries(separatrix_build_info PRIVATE separatrix_strict)
