# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
#
# One kernel, compiled once per vector width; which one runs is chosen at run time. SEPARATRIX_LANES=native leaves out the
# widths that this processor would not choose; on another processor the narrowest serves.
set(choices lanes/lane_choice.cpp lanes/structure_choice.cpp lanes/tape_choice.cpp)
set(widths avx2 avx512)
set(flags_avx2 -march=x86-64-v3)
set(flags_avx512 -march=x86-64-v4 -mprefer-vector-width=512)
if(NOT CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
  set(widths)
  set(flags_avx2)
  set(flags_avx512)
elseif(SEPARATRIX_LANES STREQUAL "native")
  execute_process(COMMAND "${CMAKE_CXX_COMPILER}" -march=native -dM -E -x c++ /dev/null OUTPUT_VARIABLE macros)
  set(widths)
  if(macros MATCHES "__AVX512F__" AND macros MATCHES "__AVX512DQ__" AND macros MATCHES "__AVX512VL__" AND
     macros MATCHES "__AVX512BW__" AND macros MATCHES "__AVX512CD__")
    set(widths avx512)
  elseif(macros MATCHES "__AVX2__" AND macros MATCHES "__BMI2__" AND macros MATCHES "__FMA__")
    set(widths avx2)
  endif()
elseif(NOT SEPARATRIX_LANES STREQUAL "all")
  message(FATAL_ERROR "SEPARATRIX_LANES: found ${SEPARATRIX_LANES}, allowed all, native")
endif()
foreach(width IN ITEMS avx2 avx512)
  set(kernels lanes/lane_${width}.cpp lanes/structure_${width}.cpp lanes/tape_${width}.cpp)
  if(width STREQUAL avx512)
    list(APPEND kernels lanes/tape_two_avx512.cpp)
  endif()
  # GCC 12 contracts complex products that its straight-line vectoriser finds, in spite of -ffp-contract=off.
  set_source_files_properties(${kernels} PROPERTIES COMPILE_OPTIONS "${flags_${width}};-fno-tree-slp-vectorize")
  if(width IN_LIST widths)
    string(TOUPPER ${width} name)
    set_property(SOURCE ${choices} APPEND PROPERTY COMPILE_DEFINITIONS LANES_${name})
  else()
    set_source_files_properties(${kernels} PROPERTIES HEADER_FILE_ONLY ON)
  endif()
endforeach()
# For processors of before 2013, and for tests.
set_source_files_properties(lanes/lane_sse2.cpp lanes/structure_sse2.cpp lanes/tape_sse2.cpp PROPERTIES COMPILE_OPTIONS "$<$<CONFIG:Release>:-O2>")
set_source_files_properties(lanes/lane_gpu_host.cpp PROPERTIES COMPILE_OPTIONS
  "-fno-tree-slp-vectorize;$<$<CONFIG:Release>:-O1>")
