# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
#
# add_layer(name [HOT|COLD] USES lower-layers... LINKS libraries...): a static library of every source in the
# folder, with a module directory of its own. HOT: benchmarks gain from -O3. COLD: no time is spent there, and
# optimisation would take most of the time of the build.
function(add_layer name)
  cmake_parse_arguments(LAYER "HOT;COLD" "" "USES;LINKS" ${ARGN})
  file(GLOB sources CONFIGURE_DEPENDS
       "${CMAKE_CURRENT_SOURCE_DIR}/${name}/*.f90" "${CMAKE_CURRENT_SOURCE_DIR}/${name}/*.F90"
       "${CMAKE_CURRENT_SOURCE_DIR}/${name}/*.c" "${CMAKE_CURRENT_SOURCE_DIR}/${name}/*.cpp")
  if(NOT sources)
    return()
  endif()
  # CMake scans for modules without a run of the preprocessor where there is nothing to preprocess.
  file(GLOB preprocessed "${CMAKE_CURRENT_SOURCE_DIR}/${name}/*.F90")
  set_source_files_properties(${preprocessed} PROPERTIES Fortran_PREPROCESS ON)
  set(target "separatrix_${name}")
  add_library(${target} STATIC ${sources})
  set(modules "${CMAKE_BINARY_DIR}/modules/${name}")
  # A module that has moved to another layer must not be found where it was.
  file(GLOB built "${modules}/*.mod")
  foreach(module IN LISTS built)
    cmake_path(GET module STEM stem)
    if(NOT "${sources}" MATCHES "/${stem}\\.[fF]90")
      file(REMOVE "${module}")
    endif()
  endforeach()
  set_target_properties(${target} PROPERTIES Fortran_MODULE_DIRECTORY "${modules}" Fortran_PREPROCESS OFF
    POSITION_INDEPENDENT_CODE ON)
  target_include_directories(${target} PUBLIC "${modules}")
  target_link_libraries(${target} PRIVATE separatrix_strict PUBLIC ${LAYER_LINKS})
  if(LAYER_HOT)
    target_compile_options(${target} PRIVATE "$<$<CONFIG:Release>:-O3>")
  elseif(LAYER_COLD)
    # With the rewritten sums and products of matrices that every level above -O0 has, so that the bits are the same.
    target_compile_options(${target} PRIVATE "$<$<CONFIG:Release>:-O0>"
      "$<$<AND:$<CONFIG:Release>,$<COMPILE_LANG_AND_ID:Fortran,GNU>>:-ffrontend-optimize>")
  endif()
  foreach(lower IN LISTS LAYER_USES)
    target_link_libraries(${target} PUBLIC "separatrix_${lower}")
  endforeach()
endfunction()
