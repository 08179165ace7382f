// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#ifndef LightTransport_Core_Diffusion_h
#define LightTransport_Core_Diffusion_h

namespace lighttransport
{
/** Why a solver stopped. Only Converged is success. */
enum class StopReason
{
  Converged,
  MaxIterations,
  Breakdown,
  NotFinite,
  Diverged,
  Cancelled,
  NoSteadyState,
  BadInput
};

const char* ToString(StopReason reason);
} // namespace lighttransport

#endif
