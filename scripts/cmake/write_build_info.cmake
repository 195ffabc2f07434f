# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
#
# Run with cmake -P by the build (version.cmake). configure_file leaves an unchanged file alone.
cmake_minimum_required(VERSION 3.25)
execute_process(
  COMMAND git -C "${SOURCE_DIR}" describe --always --dirty --abbrev=12
  RESULT_VARIABLE status OUTPUT_VARIABLE COMMIT ERROR_QUIET OUTPUT_STRIP_TRAILING_WHITESPACE)
# Outside a repository the archive names its commit, where git has filled it in.
if(NOT status EQUAL 0 OR COMMIT STREQUAL "")
  set(COMMIT "unknown")
  if(EXISTS "${SOURCE_DIR}/.git_archival.txt")
    file(READ "${SOURCE_DIR}/.git_archival.txt" archived)
    if(archived MATCHES "describe: ([^$\n]+)\n" OR archived MATCHES "node: ([0-9a-f][0-9a-f][0-9a-f][0-9a-f][0-9a-f][0-9a-f][0-9a-f][0-9a-f][0-9a-f][0-9a-f][0-9a-f][0-9a-f])")
      set(COMMIT "${CMAKE_MATCH_1}")
    endif()
  endif()
endif()

# A Fortran literal, in pieces because a line holds 132 characters.
foreach(name IN ITEMS VERSION COMMIT COMPILER FLAGS C_FLAGS MPI HDF5)
  set(rest "${${name}}")
  set(literal "")
  while(TRUE)
    string(SUBSTRING "${rest}" 0 60 piece)
    string(REPLACE "'" "''" piece "${piece}")
    string(APPEND literal "'${piece}'")
    string(LENGTH "${rest}" length)
    if(length LESS_EQUAL 60)
      break()
    endif()
    string(SUBSTRING "${rest}" 60 -1 rest)
    string(APPEND literal " // &\n    ")
  endwhile()
  set(${name} "${literal}")
endforeach()
configure_file("${TEMPLATE}" "${OUTPUT}" @ONLY)
