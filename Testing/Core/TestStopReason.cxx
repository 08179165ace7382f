// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "LightTransportTesting.h"

#include "Core/Diffusion.h"

using namespace lighttransport;

int main(int argc, char* argv[])
{
  testing::Suite suite(argc, argv);
  LT_CHECK(suite, std::string(ToString(StopReason::Converged)) == "Converged");
  LT_CHECK(suite, std::string(ToString(StopReason::BadInput)) == "BadInput");
  return suite.result();
}
