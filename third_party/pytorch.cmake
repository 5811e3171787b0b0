# torch's headers and library from the Python environment that the build serves. Target: torch_stable.
#
# A build with isolation hides that environment behind PYTHONPATH, so a second look runs with -I. The
# headers of the stable ABI and libtorch are all that is needed; no part of torch's own CMake package,
# which would ask for CUDA on machines without it.
set(find_torch "import os, torch; print(os.path.dirname(torch.__file__) + ';' + torch.__version__)")
foreach(flags "" "-I")
  execute_process(COMMAND ${Python_EXECUTABLE} ${flags} -c "${find_torch}"
    OUTPUT_VARIABLE torch_found OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET RESULT_VARIABLE torch_result)
  if(torch_result EQUAL 0)
    break()
  endif()
endforeach()
if(NOT torch_result EQUAL 0)
  message(FATAL_ERROR "PyTorch was not found by ${Python_EXECUTABLE}. To install it: "
    "pip install 'torch>=2.11' (add --index-url https://download.pytorch.org/whl/cpu where there is no GPU).")
endif()
list(GET torch_found 0 torch_dir)
list(GET torch_found 1 torch_version)
if(torch_version VERSION_LESS 2.11)
  message(FATAL_ERROR "PyTorch ${torch_version} is too old: the operators need 2.11 or newer.")
endif()
message(STATUS "PyTorch ${torch_version}")

add_library(torch_stable INTERFACE)
target_include_directories(torch_stable SYSTEM INTERFACE ${torch_dir}/include)
target_link_libraries(torch_stable INTERFACE ${torch_dir}/lib/libtorch.so ${torch_dir}/lib/libtorch_cpu.so ${torch_dir}/lib/libc10.so)
