# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
#
# cmake -DPROGRAM=... -DFOLDER=... -P CompareWithXvfb.cmake
# The same scene through EGL and through X has the same pixels, on the same driver.
set(egl "${FOLDER}/scene-egl.png")
set(xvfb "${FOLDER}/scene-xvfb.png")
file(REMOVE "${egl}" "${xvfb}")
execute_process(COMMAND "${CMAKE_COMMAND}" -E env --unset=DISPLAY "${PROGRAM}" -W "${egl}"
  RESULT_VARIABLE result OUTPUT_VARIABLE output)
if (result EQUAL 125)
  message("no EGL here: skipped")
  return ()
endif ()
if (NOT result EQUAL 0 OR NOT output MATCHES "vtkLightTransportEGLRenderWindow")
  message(FATAL_ERROR "through EGL: exit code ${result}, ${output}")
endif ()
execute_process(COMMAND sh "${CMAKE_CURRENT_LIST_DIR}/../Support/in-xvfb.sh" "${PROGRAM}" -W "${xvfb}"
  RESULT_VARIABLE result OUTPUT_VARIABLE output)
if (result EQUAL 125)
  message("no Xvfb here: skipped")
  return ()
endif ()
if (NOT result EQUAL 0 OR NOT output MATCHES "vtkXOpenGLRenderWindow")
  message(FATAL_ERROR "through X: exit code ${result}, ${output}")
endif ()
execute_process(COMMAND "${CMAKE_COMMAND}" -E compare_files "${egl}" "${xvfb}"
  RESULT_VARIABLE result)
if (NOT result EQUAL 0)
  message(FATAL_ERROR "${egl} and ${xvfb} differ")
endif ()
