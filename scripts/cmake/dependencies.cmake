# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
#
# Everything that comes from outside. Layers link the targets separatrix_mpi and separatrix_hdf5, so
# that no other file asks which build this is.

add_library(separatrix_mpi INTERFACE)
if(SEPARATRIX_MPI)
  set(MPI_DETERMINE_LIBRARY_VERSION ON)
  find_package(MPI REQUIRED COMPONENTS C Fortran)
  if(NOT MPI_Fortran_HAVE_F08_MODULE)
    message(FATAL_ERROR "This MPI has no mpi_f08 module for ${CMAKE_Fortran_COMPILER}.")
  endif()
  target_link_libraries(separatrix_mpi INTERFACE MPI::MPI_Fortran MPI::MPI_C)
  target_compile_definitions(separatrix_mpi INTERFACE SEPARATRIX_MPI)
endif()

# What was found for the other kind of linking does not stay.
if(DEFINED SEPARATRIX_STATIC_FOUND AND NOT SEPARATRIX_STATIC_FOUND STREQUAL SEPARATRIX_STATIC)
  get_cmake_property(cached CACHE_VARIABLES)
  list(FILTER cached INCLUDE REGEX "^(HDF5|GSL|ZLIB)_")
  list(FILTER cached EXCLUDE REGEX "_(ROOT|DIR)$")
  foreach(name IN LISTS cached)
    unset(${name} CACHE)
  endforeach()
endif()
set(SEPARATRIX_STATIC_FOUND ${SEPARATRIX_STATIC} CACHE INTERNAL "the kind of linking that the libraries were found for")

# Debian's shared HDF5 brings in curl and Kerberos for a driver that nothing here uses; a static one leaves that out.
if(SEPARATRIX_STATIC)
  set(HDF5_USE_STATIC_LIBRARIES ON)
endif()

# With both kinds of HDF5 installed, the module takes the one that is asked for or, silently, the other.
set(HDF5_PREFER_PARALLEL ${SEPARATRIX_MPI})
find_package(HDF5 1.10 REQUIRED COMPONENTS C Fortran HL)
if(SEPARATRIX_MPI AND NOT HDF5_IS_PARALLEL)
  message(FATAL_ERROR "SEPARATRIX_MPI=ON needs a parallel HDF5, found a serial one: "
                      "install libhdf5-openmpi-dev or set HDF5_ROOT.")
elseif(HDF5_IS_PARALLEL AND NOT SEPARATRIX_MPI)
  message(FATAL_ERROR "SEPARATRIX_MPI=OFF needs a serial HDF5, found a parallel one: "
                      "install libhdf5-dev or set HDF5_ROOT.")
endif()
# The dimension scales are in the high-level library, which HDF5::HDF5 leaves out.
add_library(separatrix_hdf5 INTERFACE)
target_include_directories(separatrix_hdf5 SYSTEM INTERFACE ${HDF5_Fortran_INCLUDE_DIRS} ${HDF5_C_INCLUDE_DIRS})
set(hdf5_libraries
  ${HDF5_Fortran_HL_LIBRARIES} ${HDF5_Fortran_LIBRARIES} ${HDF5_C_HL_LIBRARIES} ${HDF5_C_LIBRARIES})
if(SEPARATRIX_STATIC)
  # The module takes the C library statically as well; the compression library needs a second one.
  list(FILTER hdf5_libraries EXCLUDE REGEX "/lib(c|m|dl|pthread|rt)\\.a$")
  find_library(AEC_LIBRARY libaec.a)
  if(AEC_LIBRARY)
    list(APPEND hdf5_libraries "${AEC_LIBRARY}")
  endif()
  list(APPEND hdf5_libraries m dl)
  set(shared_suffixes ${CMAKE_FIND_LIBRARY_SUFFIXES})
  set(CMAKE_FIND_LIBRARY_SUFFIXES .a)
endif()
target_link_libraries(separatrix_hdf5 INTERFACE ${hdf5_libraries})

find_package(ZLIB REQUIRED)
find_package(GSL REQUIRED)
if(SEPARATRIX_STATIC)
  set(CMAKE_FIND_LIBRARY_SUFFIXES ${shared_suffixes})
endif()

# ISA-L deflates and sums many times as fast as zlib, in the same formats. Debian has no static one.
add_library(separatrix_isal INTERFACE)
if(SEPARATRIX_ISAL AND NOT SEPARATRIX_STATIC)
  find_path(ISAL_INCLUDE_DIR isa-l.h)
  find_library(ISAL_LIBRARY isal)
  if(ISAL_INCLUDE_DIR AND ISAL_LIBRARY)
    target_include_directories(separatrix_isal SYSTEM INTERFACE "${ISAL_INCLUDE_DIR}")
    target_compile_definitions(separatrix_isal INTERFACE SEPARATRIX_ISAL)
    target_link_libraries(separatrix_isal INTERFACE "${ISAL_LIBRARY}")
  else()
    message(STATUS "ISA-L was not found: zlib compresses, which takes longer")
  endif()
endif()

# Debian's package has the headers only.
find_package(toml11 QUIET)
if(NOT TARGET toml11::toml11)
  find_path(TOML11_INCLUDE_DIR toml.hpp REQUIRED)
  add_library(toml11::toml11 INTERFACE IMPORTED)
  target_include_directories(toml11::toml11 INTERFACE "${TOML11_INCLUDE_DIR}")
endif()
