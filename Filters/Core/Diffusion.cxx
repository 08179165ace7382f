// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Diffusion.h"

namespace lighttransport
{
const char* ToString(StopReason reason)
{
  switch (reason)
  {
    case StopReason::Converged:
      return "Converged";
    case StopReason::MaxIterations:
      return "MaxIterations";
    case StopReason::Breakdown:
      return "Breakdown";
    case StopReason::NotFinite:
      return "NotFinite";
    case StopReason::Diverged:
      return "Diverged";
    case StopReason::Cancelled:
      return "Cancelled";
    case StopReason::NoSteadyState:
      return "NoSteadyState";
    case StopReason::BadInput:
      return "BadInput";
  }
  return "Unknown";
}
} // namespace lighttransport
