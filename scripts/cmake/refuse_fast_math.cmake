# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
#
# Fast-math and contraction change the labels of basin maps, so neither is allowed. Contraction is
# switched off where it cannot be overridden (separatrix_strict); fast-math is refused here.
# A test runs this file alone: cmake -DCMAKE_Fortran_FLAGS=... -P refuse_fast_math.cmake
cmake_minimum_required(VERSION 3.25)
string(TOUPPER "${CMAKE_BUILD_TYPE}" config)
foreach(language IN ITEMS Fortran C CXX)
  set(flags "${CMAKE_${language}_FLAGS} ${CMAKE_${language}_FLAGS_${config}}")
  if(flags MATCHES "-Ofast|-ffast-math|-funsafe-math-optimizations|-ffinite-math-only|-fassociative-math|-freciprocal-math|-fno-signed-zeros")
    message(FATAL_ERROR "Separatrix refuses fast-math (found '${CMAKE_MATCH_0}'): it changes basin labels.")
  endif()
endforeach()
