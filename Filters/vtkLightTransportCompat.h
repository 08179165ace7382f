// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * Private to the module: the one place that knows VTK versions (9.1 to 9.6).
 * Each entry says which version needs it and when it can go.
 */
#ifndef vtkLightTransportCompat_h
#define vtkLightTransportCompat_h

#include "vtkAlgorithm.h"
#include "vtkVersionMacros.h"

/** VTK_VERSION_CHECK exists since 8.90; kept here so that callers include one header. */
#define LIGHTTRANSPORT_VTK_AT_LEAST(major, minor)                                                  \
  (VTK_VERSION_NUMBER >= VTK_VERSION_CHECK(major, minor, 0))

/**
 * The header that brings OpenGL's names: GLEW until 9.3, glad from 9.4 on. Before
 * any other OpenGL header: #include LIGHTTRANSPORT_GL_HEADER. Can go, for
 * "vtk_glad.h", when 9.3 is no longer supported.
 */
#if LIGHTTRANSPORT_VTK_AT_LEAST(9, 4)
#define LIGHTTRANSPORT_GL_HEADER "vtk_glad.h"
#else
#define LIGHTTRANSPORT_GL_HEADER "vtk_glew.h"
#endif

/**
 * Whether an overridden method of vtkObjectFactory is const: a choice of VTK's
 * build from 9.5 on (VTK_FUTURE_CONST, of vtkObjectFactory.h). Can go when 9.4 is
 * no longer supported.
 */
#if LIGHTTRANSPORT_VTK_AT_LEAST(9, 5)
#define LIGHTTRANSPORT_FACTORY_CONST VTK_FUTURE_CONST
#else
#define LIGHTTRANSPORT_FACTORY_CONST
#endif

/**
 * Whether a filter that is at work was asked to stop. CheckAbort, from 9.3 on, also
 * asks upstream and marks the output. Can go when 9.2 is no longer supported.
 */
inline bool vtkLightTransportCheckAbort(vtkAlgorithm* algorithm)
{
#if LIGHTTRANSPORT_VTK_AT_LEAST(9, 3)
  return algorithm->CheckAbort();
#else
  return algorithm->GetAbortExecute() != 0;
#endif
}

#endif
