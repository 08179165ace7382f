# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
#
# lighttransport_add_tests(LAYER Filters LIBRARIES ... TESTS TestA TestB ...
#                          [LABELS long] [ENVIRONMENT A=B ...])
#
# One executable and one ctest per TestX.cxx, with a main() of its own, labelled
# with the layer. Exit code 125 is a skip. The tests get
#   -T <folder for pictures that fail>  -B <baselines>  -D <shared data, may not exist>
# which lighttransport::testing::Arguments reads.

function (lighttransport_add_tests)
  cmake_parse_arguments(arg "" "LAYER" "LIBRARIES;TESTS;LABELS;ENVIRONMENT" ${ARGN})
  foreach (test IN LISTS arg_TESTS)
    set(name "${arg_LAYER}-${test}")
    add_executable("${test}" "${test}.cxx")
    target_link_libraries("${test}" PRIVATE LightTransportTesting ${arg_LIBRARIES})
    lighttransport_autoinit("${test}" ${arg_LIBRARIES})
    add_test(NAME "${name}" COMMAND "${test}"
      -T "${CMAKE_BINARY_DIR}/Testing/Temporary"
      -B "${CMAKE_SOURCE_DIR}/Testing/Data/Baseline"
      -D "${CMAKE_SOURCE_DIR}/../shared/data")
    set_tests_properties("${name}" PROPERTIES
      LABELS "${arg_LAYER};${arg_LABELS}"
      SKIP_RETURN_CODE 125
      TIMEOUT 300
      ENVIRONMENT "${arg_ENVIRONMENT}")
  endforeach ()
endfunction ()

# VTK's factories are registered by the executables that link VTK's modules.
function (lighttransport_autoinit target)
  set(modules)
  foreach (library IN LISTS ARGN)
    if (library MATCHES "^VTK::")
      list(APPEND modules "${library}")
    endif ()
  endforeach ()
  if (modules)
    vtk_module_autoinit(TARGETS "${target}" MODULES ${modules})
  endif ()
endfunction ()
