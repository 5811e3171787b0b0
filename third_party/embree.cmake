# Embree 4, else 3, else none. Sets SPLITNERF_EMBREE_MAJOR (4, 3 or 0); the target is `embree`.
set(SPLITNERF_EMBREE_MAJOR 0)
option(SPLITNERF_EMBREE "Trace rays with Embree (OFF: through the Python package embreex, slower)" ON)
if(SPLITNERF_EMBREE)
  find_package(embree 4 QUIET)
  if(NOT embree_FOUND)
    find_package(embree 3 QUIET)
  endif()
  if(embree_FOUND)
    string(REGEX MATCH "^[0-9]+" SPLITNERF_EMBREE_MAJOR "${embree_VERSION}")
    message(STATUS "Embree ${embree_VERSION}")
  else()
    message(WARNING "Embree was not found: rays will go through the Python package embreex, slower. "
                    "To install it: apt-get install libembree-dev (Debian, Ubuntu), "
                    "dnf install embree-devel (Fedora), brew install embree (macOS).")
  endif()
endif()

# Installs the shared libraries of Embree and its tbb beside ours, under the names by which they are asked for.
function(splitnerf_bundle_embree destination)
  install(CODE "
    file(GET_RUNTIME_DEPENDENCIES
      LIBRARIES \"$<TARGET_FILE:splitnerf_core>\"
      RESOLVED_DEPENDENCIES_VAR resolved UNRESOLVED_DEPENDENCIES_VAR unresolved
      PRE_INCLUDE_REGEXES \"embree\" \"tbb\" PRE_EXCLUDE_REGEXES \".*\")
    foreach(library IN LISTS resolved)
      get_filename_component(name \"\${library}\" NAME)
      file(REAL_PATH \"\${library}\" real)
      get_filename_component(real_name \"\${real}\" NAME)
      file(INSTALL DESTINATION \"\${CMAKE_INSTALL_PREFIX}/${destination}\" TYPE SHARED_LIBRARY FILES \"\${real}\")
      if(NOT name STREQUAL real_name)
        file(RENAME \"\${CMAKE_INSTALL_PREFIX}/${destination}/\${real_name}\"
          \"\${CMAKE_INSTALL_PREFIX}/${destination}/\${name}\")
      endif()
    endforeach()")
endfunction()
