// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * The command line of light-volume: one table says each option's name, argument, meaning and
 * how it is parsed; --help prints that table.
 */
#ifndef LightVolume_Options_h
#define LightVolume_Options_h

#include "VolumeReader.h"

#include <array>
#include <string>
#include <utility>
#include <vector>

namespace lightvolume
{
struct Point
{
  std::array<double, 3> Position = { { 0, 0, 0 } };
  bool IsVoxel = false; // written @i,j,k
};

struct Seed
{
  std::string Text; // as it was given
  Point Center;
  double Radius = -1.; // < 0: the default
  double Power = 1.;
};

struct Stroke
{
  std::string Text;
  std::vector<Point> Points;
  double Radius = -1.;
  double Power = 1.;
};

/** A point of a transfer function: value, opacity (or another number), and maybe a colour. */
struct CurvePoint
{
  double Value;
  double Number;
  bool HasColor = false;
  std::array<double, 3> Color = { { 1, 1, 1 } };
};
using Curve = std::vector<CurvePoint>;

struct Options
{
  std::string Input;
  ReadOptions Read;
  std::vector<double> NullValues;
  std::string Preset = "auto";

  std::vector<Seed> Seeds;
  std::vector<Stroke> Strokes;
  std::string Paint;
  double PaintGain = 1.;

  std::string Mapping; // empty: the preset's
  bool Complement = false;
  Curve DiffusionCurve;
  double GradientScale = 0.;        // 0: from the data
  double GradientScaleFactor = -1.; // on the one from the data; < 0: the preset's
  double Length = 0.;
  double BetaFloor = 1e-6;
  std::string Absorption; // empty: the preset's
  Curve AbsorptionCurve;
  double Albedo = -1.; // < 0: the preset's
  double Anisotropy = 0.;
  double Reach = -1.; // < 0: the preset's

  std::string Model = "diffusion";
  std::string Mode; // empty: steady, or implicit for the anisotropic model
  std::string Boundary = "robin";
  double RefractiveIndex = 1.;
  int Steps = 100;
  double Courant = 0.; // 0: 1, implicit 1000
  double Tolerance = 1e-8;
  int Iterations = 500;
  int Coarsen = 1;

  std::array<int, 2> Size = { { 960, 720 } };
  std::string View = "overlay";
  double Decades = 6.;
  double Strength = 1.;
  double LightOpacity = -1.;                    // < 0: the preset's
  double TissueOpacity = -1.;                   // < 0: the preset's
  std::vector<double> KeyLight = { -40., 40. }; // azimuth, elevation, from the viewer
  double ShadowStrength = .85;
  std::vector<double> Camera; // azimuth, elevation, zoom
  std::string Up = "z";
  Curve TransferFunction;
  std::string Title;
  std::vector<std::string> Pictures = { "plain", "lit", "slices" };
  bool Render = true;
  /** Whether any picture or file shows the light of the seeds. */
  bool NeedsSolve() const;

  std::string Out = "light-volume-out";
  double Threshold = 1e-3;
  std::vector<std::string> Files = { "vti", "vdb", "nii" };
  bool Quiet = false;

  bool Help = false;
  bool Version = false;
  /** Every option that was given, as it was given: for the report. */
  std::vector<std::pair<std::string, std::string>> Given;
};

/** Throws an Error that names the option, its value and what was expected. */
Options ParseOptions(const std::vector<std::string>& arguments);

std::string HelpText();

} // namespace lightvolume

#endif
