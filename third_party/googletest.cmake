# GoogleTest from the system.
find_package(GTest QUIET)
if(NOT GTest_FOUND)
  message(FATAL_ERROR "GoogleTest was not found. To install it: apt-get install libgtest-dev (Debian, Ubuntu), "
    "dnf install gtest-devel (Fedora), brew install googletest (macOS); or build with -DSPLITNERF_BUILD_TESTS=OFF.")
endif()
