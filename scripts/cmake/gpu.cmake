# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
#
# The kernel of the lanes for GPUs: an object made by nvcc, of an installed CUDA toolkit or of the wheels of
# requirements-gpu.txt in .venv. Not by CMake's own CUDA, which needs a whole toolkit.
set(SEPARATRIX_GPU_ARCHITECTURES "80;90" CACHE STRING "Compute capabilities that the kernel for GPUs is made for")

file(GLOB wheels "${PROJECT_SOURCE_DIR}/.venv/lib/python3*/site-packages/nvidia/cu13")
find_program(SEPARATRIX_NVCC nvcc HINTS "$ENV{CUDA_HOME}/bin" ${wheels} /usr/local/cuda PATH_SUFFIXES bin)
if(NOT SEPARATRIX_NVCC)
  message(FATAL_ERROR "SEPARATRIX_GPU=ON needs nvcc: install a CUDA toolkit and set CUDA_HOME, or "
                      ".venv/bin/pip install -r requirements-gpu.txt")
endif()
cmake_path(GET SEPARATRIX_NVCC PARENT_PATH folder)
cmake_path(GET folder PARENT_PATH folder)
find_library(SEPARATRIX_CUDART cudart_static HINTS "${folder}/lib64" "${folder}/lib" NO_DEFAULT_PATH REQUIRED)

# The operations of the processor and no others: multiplications and additions are not fused, divisions and roots are
# correctly rounded, small numbers stay. For later processors the driver compiles what is kept of the last of the list;
# its operations carry their rounding, so that it cannot fuse them either.
set(SEPARATRIX_NVCC_FLAGS -std=c++17 -O3 -fmad=false -prec-div=true -prec-sqrt=true -ftz=false -Xcompiler=-fPIC)
foreach(capability IN LISTS SEPARATRIX_GPU_ARCHITECTURES)
  list(APPEND architectures "-gencode=arch=compute_${capability},code=sm_${capability}")
endforeach()
list(GET SEPARATRIX_GPU_ARCHITECTURES -1 newest)
list(APPEND architectures "-gencode=arch=compute_${newest},code=compute_${newest}")

# add_gpu_object(target source): compiles a .cu and links it, with the runtime, into a target.
function(add_gpu_object target source)
  cmake_path(GET source STEM name)
  cmake_path(GET source PARENT_PATH folder)
  set(object "${CMAKE_CURRENT_BINARY_DIR}/${name}.cu.o")
  file(GLOB headers CONFIGURE_DEPENDS "${CMAKE_CURRENT_SOURCE_DIR}/${folder}/*.hpp")
  add_custom_command(OUTPUT "${object}"
    COMMAND "${SEPARATRIX_NVCC}" ${SEPARATRIX_NVCC_FLAGS} ${architectures} "-ccbin=${CMAKE_CXX_COMPILER}"
            -c "${CMAKE_CURRENT_SOURCE_DIR}/${source}" -o "${object}"
    DEPENDS "${CMAKE_CURRENT_SOURCE_DIR}/${source}" ${headers}
    COMMENT "Building CUDA object ${name}.cu.o" VERBATIM COMMAND_EXPAND_LISTS)
  target_sources(${target} PRIVATE "${object}")
  set_source_files_properties("${object}" PROPERTIES EXTERNAL_OBJECT TRUE GENERATED TRUE)
  target_compile_definitions(${target} PRIVATE SEPARATRIX_GPU)
  find_package(Threads REQUIRED)
  target_link_libraries(${target} PUBLIC "${SEPARATRIX_CUDART}" Threads::Threads ${CMAKE_DL_LIBS} rt)
endfunction()
