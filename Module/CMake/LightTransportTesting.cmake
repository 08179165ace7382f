# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
#
# lighttransport_add_tests(LAYER Filters LIBRARIES ... TESTS TestA TestB ...
#                          [LABELS long] [ENVIRONMENT A=B ...] [NO_LEAK_CHECK])
#
# One executable and one ctest per TestX.cxx, with a main() of its own, labelled
# with the layer. Exit code 125 is a skip. The tests get
#   -T <folder for pictures that fail>  -B <baselines>  -D <shared data, may not exist>
# which lighttransport::testing::Arguments reads.
#
# lighttransport_add_python_tests(TESTS TestA TestB ... [LABELS long] [ENVIRONMENT A=B ...])
#
# One ctest per TestX.py, with the build tree's package and without a display.
#
# Targets: tests-<layer> builds a layer's tests; check-<layer> also runs those
# that are not labelled long or benchmark, once after each change (the
# sanitizer builds are checked that way).

set(LIGHTTRANSPORT_TEST_ARGUMENTS
  -T "${CMAKE_BINARY_DIR}/Testing/Temporary"
  -B "${CMAKE_SOURCE_DIR}/Testing/Data/Baseline"
  -D "${CMAKE_SOURCE_DIR}/../shared/data")

function (lighttransport_add_tests)
  cmake_parse_arguments(arg "NO_LEAK_CHECK" "LAYER" "LIBRARIES;TESTS;LABELS;ENVIRONMENT" ${ARGN})
  foreach (test IN LISTS arg_TESTS)
    set(name "${arg_LAYER}-${test}")
    add_executable("${test}" "${test}.cxx")
    target_link_libraries("${test}" PRIVATE LightTransportTesting ${arg_LIBRARIES})
    lighttransport_autoinit("${test}" ${arg_LIBRARIES})
    # Mesa passes; a GPU's driver may keep what it once allocated (then
    # LSAN_OPTIONS=suppressions=FILE, or without LIGHTTRANSPORT_LEAK_CHECK).
    if (LIGHTTRANSPORT_LEAK_CHECK AND NOT arg_NO_LEAK_CHECK)
      target_link_options("${test}" PRIVATE -fsanitize=leak)
    endif ()
    add_test(NAME "${name}" COMMAND "${test}" ${LIGHTTRANSPORT_TEST_ARGUMENTS})
    set_tests_properties("${name}" PROPERTIES
      LABELS "${arg_LAYER};${arg_LABELS}"
      SKIP_RETURN_CODE 125
      TIMEOUT 300
      ENVIRONMENT "${arg_ENVIRONMENT}")
    set_property(GLOBAL APPEND PROPERTY "lighttransport_tests_${arg_LAYER}" "${test}")
  endforeach ()
endfunction ()

function (lighttransport_add_python_tests)
  cmake_parse_arguments(arg "" "" "TESTS;LABELS;ENVIRONMENT" ${ARGN})
  foreach (test IN LISTS arg_TESTS)
    set(name "Python-${test}")
    add_test(NAME "${name}" COMMAND "${Python3_EXECUTABLE}" -B
      "${CMAKE_CURRENT_SOURCE_DIR}/${test}.py" ${LIGHTTRANSPORT_TEST_ARGUMENTS})
    set_tests_properties("${name}" PROPERTIES
      LABELS "Python;${arg_LABELS}"
      SKIP_RETURN_CODE 125
      TIMEOUT 300
      ENVIRONMENT "PYTHONPATH=${LIGHTTRANSPORT_PYTHONPATH};DISPLAY=;${arg_ENVIRONMENT}")
  endforeach ()
endfunction ()

# After all tests of the layer were added.
function (lighttransport_add_check layer)
  get_property(tests GLOBAL PROPERTY "lighttransport_tests_${layer}")
  add_custom_target("tests-${layer}" DEPENDS ${tests})
  if (NOT tests)
    add_custom_target("check-${layer}")
    return ()
  endif ()
  # Debian 12's ThreadSanitizer dies where the kernel randomises addresses by
  # more than 28 bits, so there the tests run without, if that is allowed.
  set(wrapper)
  if ("thread" IN_LIST LIGHTTRANSPORT_SANITIZE)
    execute_process(COMMAND setarch -R true RESULT_VARIABLE result ERROR_QUIET OUTPUT_QUIET)
    if (result EQUAL 0)
      set(wrapper setarch -R)
    endif ()
  endif ()
  set(stamp "${CMAKE_BINARY_DIR}/Testing/Temporary/check-${layer}.stamp")
  add_custom_command(
    OUTPUT "${stamp}"
    COMMAND ${wrapper} "${CMAKE_CTEST_COMMAND}" --output-on-failure --no-tests=error
      -L "^${layer}$" -LE "^(long|benchmark)$" -j 2
    COMMAND "${CMAKE_COMMAND}" -E touch "${stamp}"
    DEPENDS ${tests}
    WORKING_DIRECTORY "${CMAKE_BINARY_DIR}"
    USES_TERMINAL
    VERBATIM
    COMMENT "Running the tests of ${layer}")
  add_custom_target("check-${layer}" DEPENDS "${stamp}")
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
