# torch's headers and library from the Python environment that the build serves. Target: torch_stable.
#
# A build with isolation hides that environment behind PYTHONPATH, so a second look runs with -I. The
# headers of the stable ABI and libtorch are all that is needed; no part of torch's own CMake package,
# which would ask for CUDA on machines without it.
set(SPLITNERF_TORCH "" CACHE PATH "Folder of an installed torch package, of any Python (default: that of the Python that builds)")
set(torch_dir ${SPLITNERF_TORCH})
set(find_torch "import importlib.util as u; print(u.find_spec('torch').submodule_search_locations[0])")
foreach(flags "" "-I")
  if(NOT torch_dir)
    execute_process(COMMAND ${Python_EXECUTABLE} ${flags} -c "${find_torch}"
      OUTPUT_VARIABLE torch_dir OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
  endif()
endforeach()
if(NOT EXISTS "${torch_dir}/version.py")
  message(FATAL_ERROR "PyTorch was not found by ${Python_EXECUTABLE}. To install it: "
    "pip install 'torch>=2.11' (add --index-url https://download.pytorch.org/whl/cpu where there is no GPU).")
endif()
file(STRINGS "${torch_dir}/version.py" torch_version REGEX "^__version__ *=")
string(REGEX REPLACE ".*['\"]([^'\"]+)['\"].*" "\\1" torch_version "${torch_version}")
if(torch_version VERSION_LESS 2.11)
  message(FATAL_ERROR "PyTorch ${torch_version} is too old: the operators need 2.11 or newer.")
endif()
message(STATUS "PyTorch ${torch_version}")

add_library(torch_stable INTERFACE)
target_include_directories(torch_stable SYSTEM INTERFACE ${torch_dir}/include)
# torch's macros and headers name their files in messages: without the folders of the machine that built.
target_compile_options(torch_stable INTERFACE
  $<$<COMPILE_LANGUAGE:CXX>:-fmacro-prefix-map=${torch_dir}/=torch/;-fmacro-prefix-map=${PROJECT_SOURCE_DIR}/=>)
target_link_libraries(torch_stable INTERFACE ${torch_dir}/lib/libtorch.so ${torch_dir}/lib/libtorch_cpu.so ${torch_dir}/lib/libc10.so)
