// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * Private to the module: what its filters share and nobody else needs.
 */
#ifndef vtkLightTransportInternal_h
#define vtkLightTransportInternal_h

#include "Core/Parallel.h"

#include "vtkSMPTools.h"

/** The kernels' parallel-for, on vtkSMPTools. */
inline lighttransport::ParallelFor vtkLightTransportParallelFor()
{
  return [](std::int64_t n, const lighttransport::RangeBody& body)
  {
    auto range = [&body](vtkIdType begin, vtkIdType end) { body(begin, end); };
    vtkSMPTools::For(0, n, range);
  };
}

#endif
