# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
#
# Target tidy: clang-tidy 14 on the libraries' sources (checks: .clang-tidy). A
# file is looked at again only when it, one of the project's headers or the list
# of checks changed.

function (lighttransport_add_tidy)
  find_program(CLANG_TIDY_PROGRAM NAMES clang-tidy-14 clang-tidy)
  mark_as_advanced(CLANG_TIDY_PROGRAM)
  if (NOT CLANG_TIDY_PROGRAM)
    return ()
  endif ()
  set(targets LightTransportCore)
  foreach (module IN ITEMS Filters Rendering LightTransport)
    get_target_property(target "LightTransport::${module}" ALIASED_TARGET)
    list(APPEND targets "${target}")
  endforeach ()

  set(sources)
  foreach (target IN LISTS targets)
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

  file(GLOB headers CONFIGURE_DEPENDS
    "${CMAKE_SOURCE_DIR}/Filters/*.h" "${CMAKE_SOURCE_DIR}/Filters/Core/*.h"
    "${CMAKE_SOURCE_DIR}/Rendering/*.h" "${CMAKE_SOURCE_DIR}/Module/*.h")
  set(stamps)
  foreach (source IN LISTS sources)
    file(RELATIVE_PATH name "${CMAKE_SOURCE_DIR}" "${source}")
    set(stamp "${CMAKE_BINARY_DIR}/tidy/${name}.stamp")
    get_filename_component(folder "${stamp}" DIRECTORY)
    file(MAKE_DIRECTORY "${folder}")
    add_custom_command(
      OUTPUT "${stamp}"
      COMMAND "${CLANG_TIDY_PROGRAM}" --quiet -p "${CMAKE_BINARY_DIR}" "${source}"
      COMMAND "${CMAKE_COMMAND}" -E touch "${stamp}"
      DEPENDS "${source}" ${headers} "${CMAKE_SOURCE_DIR}/.clang-tidy"
      VERBATIM
      COMMENT "clang-tidy ${name}")
    list(APPEND stamps "${stamp}")
  endforeach ()
  # Built first: the sources include generated headers.
  add_custom_target(tidy DEPENDS ${stamps})
  add_dependencies(tidy ${targets})
endfunction ()
