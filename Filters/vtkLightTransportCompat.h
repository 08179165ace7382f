// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * Private to the module: the one place that knows VTK versions (9.1 to 9.6).
 * Each entry says which version needs it and when it can go.
 */
#ifndef vtkLightTransportCompat_h
#define vtkLightTransportCompat_h

#include "vtkVersionMacros.h"

/** VTK_VERSION_CHECK exists since 8.90; kept here so that callers include one header. */
#define LIGHTTRANSPORT_VTK_AT_LEAST(major, minor)                                                  \
  (VTK_VERSION_NUMBER >= VTK_VERSION_CHECK(major, minor, 0))

#endif
