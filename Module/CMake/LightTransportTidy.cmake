# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
#
# Target tidy: clang-tidy 14 on the libraries' sources (checks: .clang-tidy); tidy-all: on those of
# the tests, benchmarks and examples as well, which takes two cores two and a half minutes more. A
# file is looked at again only when it, one of the project's headers or the list of checks changed.

# The sources of some targets, without what the build makes.
function (lighttransport_tidy_sources result)
  set(sources)
  foreach (target IN LISTS ARGN)
    get_target_property(files "${target}" SOURCES)
    get_target_property(folder "${target}" SOURCE_DIR)
    foreach (file IN LISTS files)
      if (file MATCHES "\\.cxx$" AND NOT file MATCHES "\\$<")
        get_filename_component(file "${file}" ABSOLUTE BASE_DIR "${folder}")
        cmake_path(IS_PREFIX CMAKE_BINARY_DIR "${file}" generated)
        if (NOT generated)
          list(APPEND sources "${file}")
        endif ()
      endif ()
    endforeach ()
  endforeach ()
  list(REMOVE_DUPLICATES sources)
  set("${result}" "${sources}" PARENT_SCOPE)
endfunction ()

# The programs and libraries of a folder and those below it.
function (lighttransport_targets_below result folder)
  get_property(targets DIRECTORY "${folder}" PROPERTY BUILDSYSTEM_TARGETS)
  set(found)
  foreach (target IN LISTS targets)
    get_target_property(type "${target}" TYPE)
    if (type MATCHES "EXECUTABLE|_LIBRARY" AND NOT type STREQUAL INTERFACE_LIBRARY)
      list(APPEND found "${target}")
    endif ()
  endforeach ()
  get_property(folders DIRECTORY "${folder}" PROPERTY SUBDIRECTORIES)
  foreach (below IN LISTS folders)
    lighttransport_targets_below(more "${below}")
    list(APPEND found ${more})
  endforeach ()
  set("${result}" "${found}" PARENT_SCOPE)
endfunction ()

# A target that looks at SOURCES once TARGETS are built, whose generated headers they include.
function (lighttransport_tidy_target name)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "OPTIONS;SOURCES;HEADERS;TARGETS")
  set(stamps)
  foreach (source IN LISTS arg_SOURCES)
    file(RELATIVE_PATH relative "${CMAKE_SOURCE_DIR}" "${source}")
    set(stamp "${CMAKE_BINARY_DIR}/tidy/${relative}.stamp")
    get_filename_component(folder "${stamp}" DIRECTORY)
    file(MAKE_DIRECTORY "${folder}")
    add_custom_command(
      OUTPUT "${stamp}"
      COMMAND "${CLANG_TIDY_PROGRAM}" --quiet -p "${CMAKE_BINARY_DIR}" ${arg_OPTIONS} "${source}"
      COMMAND "${CMAKE_COMMAND}" -E touch "${stamp}"
      DEPENDS "${source}" ${arg_HEADERS} "${CMAKE_SOURCE_DIR}/.clang-tidy"
      VERBATIM
      COMMENT "clang-tidy ${relative}")
    list(APPEND stamps "${stamp}")
  endforeach ()
  add_custom_target("${name}" DEPENDS ${stamps})
  add_dependencies("${name}" ${arg_TARGETS})
endfunction ()

function (lighttransport_add_tidy)
  find_program(CLANG_TIDY_PROGRAM NAMES clang-tidy-14 clang-tidy)
  mark_as_advanced(CLANG_TIDY_PROGRAM)
  if (NOT CLANG_TIDY_PROGRAM)
    return ()
  endif ()
  set(libraries LightTransportCore)
  foreach (module IN ITEMS Filters Rendering LightTransport)
    get_target_property(target "LightTransport::${module}" ALIASED_TARGET)
    list(APPEND libraries "${target}")
  endforeach ()
  lighttransport_tidy_sources(sources ${libraries})
  file(GLOB headers CONFIGURE_DEPENDS
    "${CMAKE_SOURCE_DIR}/Filters/*.h" "${CMAKE_SOURCE_DIR}/Filters/Core/*.h"
    "${CMAKE_SOURCE_DIR}/Rendering/*.h" "${CMAKE_SOURCE_DIR}/Module/*.h")
  lighttransport_tidy_target(tidy SOURCES ${sources} HEADERS ${headers} TARGETS ${libraries})

  lighttransport_targets_below(programs "${CMAKE_SOURCE_DIR}/Testing")
  if (LIGHTTRANSPORT_BUILD_EXAMPLES)
    lighttransport_targets_below(examples "${CMAKE_SOURCE_DIR}/Examples")
    list(APPEND programs ${examples})
  endif ()
  lighttransport_tidy_sources(sources ${programs})
  file(GLOB_RECURSE more CONFIGURE_DEPENDS
    "${CMAKE_SOURCE_DIR}/Testing/*.h" "${CMAKE_SOURCE_DIR}/Examples/*.h")
  lighttransport_tidy_target(tidy-programs
    OPTIONS "--checks=-performance-inefficient-string-concatenation"
      "--header-filter=/(Filters|Rendering|Module|Testing|Examples)/([A-Za-z]+/)?[^/]+\\.h$"
    SOURCES ${sources} HEADERS ${headers} ${more} TARGETS ${libraries})
  add_custom_target(tidy-all)
  add_dependencies(tidy-all tidy tidy-programs)
endfunction ()
