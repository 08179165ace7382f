# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
#
# What the root CMakeLists.txt calls: build defaults, finding VTK, building the modules.

macro (lighttransport_set_build_defaults)
  if (NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES)
    set(CMAKE_BUILD_TYPE Release CACHE STRING "Build type" FORCE)
  endif ()
  set(CMAKE_CXX_STANDARD 17)
  set(CMAKE_CXX_STANDARD_REQUIRED ON)
  set(CMAKE_CXX_EXTENSIONS OFF)
  set(CMAKE_CXX_VISIBILITY_PRESET hidden)
  set(CMAKE_VISIBILITY_INLINES_HIDDEN ON)
  set(CMAKE_POSITION_INDEPENDENT_CODE ON)
  set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
  set(CMAKE_RUNTIME_OUTPUT_DIRECTORY "${CMAKE_BINARY_DIR}/${CMAKE_INSTALL_BINDIR}")
  set(CMAKE_LIBRARY_OUTPUT_DIRECTORY "${CMAKE_BINARY_DIR}/${CMAKE_INSTALL_LIBDIR}")
  set(CMAKE_ARCHIVE_OUTPUT_DIRECTORY "${CMAKE_BINARY_DIR}/${CMAKE_INSTALL_LIBDIR}")
  # An installation may be moved: libraries and programs look beside themselves.
  if (NOT CMAKE_INSTALL_RPATH AND UNIX AND NOT APPLE)
    file(RELATIVE_PATH lighttransport_bin_to_lib
      "/prefix/${CMAKE_INSTALL_BINDIR}" "/prefix/${CMAKE_INSTALL_LIBDIR}")
    set(CMAKE_INSTALL_RPATH "$ORIGIN" "$ORIGIN/${lighttransport_bin_to_lib}")
  endif ()
  find_program(CCACHE_PROGRAM ccache)
  mark_as_advanced(CCACHE_PROGRAM)
  if (CCACHE_PROGRAM)
    set(CMAKE_CXX_COMPILER_LAUNCHER "${CCACHE_PROGRAM}")
  endif ()
endmacro ()

# The components are named because Debian's VTK without them asks for Qt.
macro (lighttransport_find_vtk)
  set(lighttransport_vtk_components
    CommonCore CommonDataModel CommonExecutionModel CommonMath CommonSystem CommonTransforms
    FiltersCore FiltersSources ImagingCore
    RenderingCore RenderingOpenGL2 RenderingVolume RenderingVolumeOpenGL2
    RenderingAnnotation RenderingFreeType InteractionStyle IOImage IOXML)
  # What the modules alone use is what LightTransportConfig.cmake asks of a user's VTK.
  set(lighttransport_vtk_public_components ${lighttransport_vtk_components})
  if (LIGHTTRANSPORT_WRAP_PYTHON)
    list(APPEND lighttransport_vtk_components WrappingPythonCore Python)
    # A python of the user's own in PATH has no vtkmodules; the system's has.
    if (NOT Python3_EXECUTABLE AND EXISTS /usr/bin/python3)
      set(Python3_EXECUTABLE /usr/bin/python3 CACHE FILEPATH "Python with VTK's modules")
    endif ()
  endif ()
  if (LIGHTTRANSPORT_BUILD_TESTING)
    list(APPEND lighttransport_vtk_components TestingCore TestingRendering)
  endif ()
  # glew and opengl until VTK 9.3, glad from 9.4 on.
  find_package(VTK 9.1 REQUIRED COMPONENTS ${lighttransport_vtk_components}
    OPTIONAL_COMPONENTS glad glew opengl)
endmacro ()

function (lighttransport_compile_options)
  if (NOT CMAKE_CXX_COMPILER_ID MATCHES "GNU|Clang")
    return ()
  endif ()
  add_compile_options($<$<COMPILE_LANGUAGE:CXX>:-Wall> $<$<COMPILE_LANGUAGE:CXX>:-Wextra>)
  if (LIGHTTRANSPORT_WARNINGS_AS_ERRORS)
    add_compile_options($<$<COMPILE_LANGUAGE:CXX>:-Werror>)
  endif ()
  if (LIGHTTRANSPORT_SANITIZE)
    if (LIGHTTRANSPORT_WRAP_PYTHON)
      message(FATAL_ERROR "LIGHTTRANSPORT_SANITIZE=${LIGHTTRANSPORT_SANITIZE} needs "
        "LIGHTTRANSPORT_WRAP_PYTHON=OFF: python itself is not instrumented")
    endif ()
    # vptr needs the type information of VTK's classes, which are built without.
    string(REPLACE ";" "," sanitizers "${LIGHTTRANSPORT_SANITIZE}")
    set(flags -fsanitize=${sanitizers} -fno-sanitize-recover=all -fno-omit-frame-pointer)
    if ("undefined" IN_LIST LIGHTTRANSPORT_SANITIZE)
      list(APPEND flags -fno-sanitize=vptr)
    endif ()
    add_compile_options(${flags} -g1)
    add_link_options(${flags})
  endif ()
endfunction ()

# A function, so that CMAKE_BINARY_DIR and the re-entry flag change here alone:
# vtk_module_build puts a module in its folder below CMAKE_BINARY_DIR, and the
# umbrella's would be the build folder itself.
function (lighttransport_build_modules)
  vtk_module_scan(
    MODULE_FILES ${ARGN}
    REQUEST_MODULES LightTransport::LightTransport
    PROVIDES_MODULES lighttransport_modules
    ENABLE_TESTS OFF)
  set(LIGHTTRANSPORT_REENTERED ON)
  set(lighttransport_top_binary_dir "${CMAKE_BINARY_DIR}")
  set(CMAKE_BINARY_DIR "${CMAKE_BINARY_DIR}/modules")
  set(LIGHTTRANSPORT_HEADERS_DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}/lighttransport")
  vtk_module_build(
    MODULES ${lighttransport_modules}
    PACKAGE LightTransport
    INSTALL_EXPORT LightTransport
    LIBRARY_NAME_SUFFIX ""
    VERSION "${LightTransport_VERSION}"
    SOVERSION "${LightTransport_VERSION_MAJOR}"
    HEADERS_DESTINATION "${LIGHTTRANSPORT_HEADERS_DESTINATION}"
    CMAKE_DESTINATION "${CMAKE_INSTALL_LIBDIR}/cmake/LightTransport"
    INSTALL_HEADERS ON)
  set(lighttransport_modules "${lighttransport_modules}" PARENT_SCOPE)
  if (LIGHTTRANSPORT_WRAP_PYTHON)
    set(CMAKE_BINARY_DIR "${lighttransport_top_binary_dir}")
    vtk_module_wrap_python(
      MODULES ${lighttransport_modules}
      TARGET LightTransport::Python
      PYTHON_PACKAGE "lighttransport"
      CMAKE_DESTINATION "${CMAKE_INSTALL_LIBDIR}/cmake/LightTransport"
      LIBRARY_DESTINATION "${CMAKE_INSTALL_LIBDIR}"
      SOABI "${Python3_SOABI}"
      BUILD_STATIC OFF)
    lighttransport_python_package()
  endif ()
endfunction ()

# Our own __init__.py beside the wrapped modules, in the build tree and the install.
function (lighttransport_python_package)
  vtk_module_python_default_destination(destination)
  set(source "${CMAKE_SOURCE_DIR}/Module/Python/__init__.py")
  set(built "${CMAKE_BINARY_DIR}/${destination}/lighttransport/__init__.py")
  add_custom_command(
    OUTPUT "${built}"
    COMMAND "${CMAKE_COMMAND}" -E copy "${source}" "${built}"
    DEPENDS "${source}"
    COMMENT "Copying the Python package")
  add_custom_target(lighttransport_python ALL DEPENDS "${built}")
  install(FILES "${source}" DESTINATION "${destination}/lighttransport" COMPONENT python)
  set(LIGHTTRANSPORT_PYTHONPATH "${CMAKE_BINARY_DIR}/${destination}"
    CACHE INTERNAL "PYTHONPATH of the build tree")
  set(LIGHTTRANSPORT_PYTHON_DESTINATION "${destination}"
    CACHE INTERNAL "The same below an installation's prefix")
endfunction ()

# What find_package(LightTransport) reads in an installation.
function (lighttransport_install_config)
  include(CMakePackageConfigHelpers)
  set(destination "${CMAKE_INSTALL_LIBDIR}/cmake/LightTransport")
  configure_package_config_file(
    "${CMAKE_CURRENT_SOURCE_DIR}/Module/CMake/LightTransportConfig.cmake.in"
    "${CMAKE_CURRENT_BINARY_DIR}/LightTransportConfig.cmake"
    INSTALL_DESTINATION "${destination}")
  write_basic_package_version_file(
    "${CMAKE_CURRENT_BINARY_DIR}/LightTransportConfigVersion.cmake"
    VERSION "${LightTransport_VERSION}" COMPATIBILITY SameMinorVersion)
  install(FILES
    "${CMAKE_CURRENT_BINARY_DIR}/LightTransportConfig.cmake"
    "${CMAKE_CURRENT_BINARY_DIR}/LightTransportConfigVersion.cmake"
    DESTINATION "${destination}" COMPONENT development)
  install(FILES LICENSE README.md
    DESTINATION "${CMAKE_INSTALL_DATADIR}/doc/lighttransport" COMPONENT runtime)
endfunction ()
