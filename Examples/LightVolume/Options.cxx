// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Options.h"

#include "RawData.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <limits>

namespace lightvolume
{
namespace
{
constexpr double Infinity = std::numeric_limits<double>::infinity();

struct Option
{
  const char* Name;
  const char* Argument; // "" for a switch
  const char* Help;
  std::function<void(Options&, const std::string&)> Parse;
};

[[noreturn]] void Refuse(
  const std::string& name, const std::string& value, const std::string& expected)
{
  throw Error(name + " is '" + value + "'; expected " + expected);
}

std::vector<std::string> Split(const std::string& text, char separator)
{
  std::vector<std::string> parts;
  std::size_t at = 0;
  while (true)
  {
    const std::size_t end = text.find(separator, at);
    parts.push_back(text.substr(at, end == std::string::npos ? end : end - at));
    if (end == std::string::npos)
    {
      return parts;
    }
    at = end + 1;
  }
}

bool ToNumber(const std::string& text, double& number)
{
  if (text.empty())
  {
    return false;
  }
  char* end = nullptr;
  number = std::strtod(text.c_str(), &end);
  return *end == '\0' && end != text.c_str();
}

/** Finite numbers between separators; empty if any part is something else. */
std::vector<double> ToNumbers(const std::string& text, char separator)
{
  std::vector<double> numbers;
  for (const std::string& part : Split(text, separator))
  {
    double number = 0.;
    if (!ToNumber(Trim(part), number) || !std::isfinite(number))
    {
      return {};
    }
    numbers.push_back(number);
  }
  return numbers;
}

double ParseNumber(const std::string& name, const std::string& value, double lo, double hi,
  const std::string& expected, bool openLo = false)
{
  double number = 0.;
  if (!ToNumber(value, number) || !std::isfinite(number) || number < lo || number > hi ||
    (openLo && number == lo))
  {
    Refuse(name, value, expected);
  }
  return number;
}

int ParseInteger(
  const std::string& name, const std::string& value, int lo, int hi, const std::string& expected)
{
  const double number = ParseNumber(name, value, lo, hi, expected);
  if (number != std::floor(number))
  {
    Refuse(name, value, expected);
  }
  return static_cast<int>(number);
}

std::string ParseChoice(
  const std::string& name, const std::string& value, const std::vector<std::string>& choices)
{
  if (std::find(choices.begin(), choices.end(), value) == choices.end())
  {
    std::string expected;
    for (std::size_t i = 0; i < choices.size(); ++i)
    {
      expected += (i == 0 ? "" : i + 1 == choices.size() ? " or " : ", ") + choices[i];
    }
    Refuse(name, value, expected);
  }
  return value;
}

std::vector<std::string> ParseSubset(
  const std::string& name, const std::string& value, const std::vector<std::string>& choices)
{
  std::vector<std::string> subset;
  if (value == "none")
  {
    return subset;
  }
  for (const std::string& part : Split(value, ','))
  {
    subset.push_back(ParseChoice(name, part, choices));
  }
  return subset;
}

Seed ParseSeed(const std::string& name, const std::string& value)
{
  const std::string expected = "x,y,z[,radius[,power]] or @i,j,k[,radius[,power]]";
  Seed seed;
  seed.Text = value;
  std::string text = Trim(value);
  seed.Center.IsVoxel = !text.empty() && text[0] == '@';
  const std::vector<double> n = ToNumbers(seed.Center.IsVoxel ? text.substr(1) : text, ',');
  if (n.size() < 3 || n.size() > 5)
  {
    Refuse(name, value, expected);
  }
  std::copy(n.begin(), n.begin() + 3, seed.Center.Position.begin());
  if (n.size() > 3)
  {
    seed.Radius = n[3];
    if (n[3] < 0.)
    {
      Refuse(name, value, "a radius of at least 0 (0 is one voxel)");
    }
  }
  seed.Power = n.size() > 4 ? n[4] : 1.;
  if (seed.Power == 0.)
  {
    Refuse(name, value, "a power other than 0 (negative takes light away)");
  }
  return seed;
}

Stroke ParseStroke(const std::string& name, const std::string& value)
{
  const std::string expected =
    "POINT:POINT[:POINT...][:r=RADIUS][:p=POWER] with points x,y,z or @i,j,k";
  Stroke stroke;
  stroke.Text = value;
  for (const std::string& part : Split(value, ':'))
  {
    double number = 0.;
    if (part.compare(0, 2, "r=") == 0 || part.compare(0, 2, "p=") == 0)
    {
      if (!ToNumber(part.substr(2), number) || !std::isfinite(number) ||
        (part[0] == 'r' ? number < 0. : number == 0.))
      {
        Refuse(name, value, expected);
      }
      (part[0] == 'r' ? stroke.Radius : stroke.Power) = number;
      continue;
    }
    Point point;
    point.IsVoxel = !part.empty() && part[0] == '@';
    const std::vector<double> n = ToNumbers(point.IsVoxel ? part.substr(1) : part, ',');
    if (n.size() != 3)
    {
      Refuse(name, value, expected);
    }
    std::copy(n.begin(), n.end(), point.Position.begin());
    stroke.Points.push_back(point);
  }
  if (stroke.Points.size() < 2)
  {
    Refuse(name, value, expected);
  }
  return stroke;
}

/** value:number[:RRGGBB],... */
Curve ParseCurve(
  const std::string& name, const std::string& value, double lo, double hi, bool colors)
{
  const std::string expected = std::string("value:number") + (colors ? "[:RRGGBB]" : "") +
    ",... with growing values and numbers from " + FormatNumber(lo) + " to " + FormatNumber(hi);
  Curve curve;
  for (const std::string& part : Split(value, ','))
  {
    const std::vector<std::string> fields = Split(part, ':');
    CurvePoint point = { 0., 0. };
    if (fields.size() < 2 || fields.size() > (colors ? 3U : 2U) ||
      !ToNumber(fields[0], point.Value) || !ToNumber(fields[1], point.Number) ||
      !std::isfinite(point.Value) || !(point.Number >= lo && point.Number <= hi) ||
      (!curve.empty() && !(point.Value > curve.back().Value)))
    {
      Refuse(name, value, expected);
    }
    if (fields.size() == 3)
    {
      char* end = nullptr;
      const unsigned long rgb = std::strtoul(fields[2].c_str(), &end, 16);
      if (fields[2].size() != 6 || *end != '\0')
      {
        Refuse(name, value, expected);
      }
      point.HasColor = true;
      for (int c = 0; c < 3; ++c)
      {
        point.Color[c] = static_cast<double>((rgb >> (16 - 8 * c)) & 255U) / 255.;
      }
    }
    curve.push_back(point);
  }
  return curve;
}

std::vector<double> ParseCamera(const std::string& name, const std::string& value)
{
  static const std::vector<std::pair<std::string, std::vector<double>>> views = {
    { "front", { 0, 0 } }, { "left", { 90, 0 } }, { "back", { 180, 0 } }, { "right", { -90, 0 } },
    { "top", { 0, 89.9 } }, { "bottom", { 0, -89.9 } }
  };
  for (const auto& view : views)
  {
    if (value == view.first)
    {
      return view.second;
    }
  }
  std::vector<double> n = ToNumbers(value, ',');
  if (n.size() < 2 || n.size() > 3 || std::abs(n[1]) > 90. || (n.size() == 3 && !(n[2] > 0.)))
  {
    Refuse(name, value,
      "azimuth,elevation[,zoom] in degrees (elevation -90 to 90, zoom above 0), or front, back, "
      "left, right, top, bottom");
  }
  return n;
}

const std::vector<Option>& Table()
{
  using S = const std::string&;
  static const std::vector<Option> table = {
    { "", "", "Input", {} },
    { "--preset", "NAME",
      "auto (default), ct, mr or seismic: how the volume looks and where light passes",
      [](Options& o, S v) {
        o.Preset = ParseChoice("--preset", v, { "auto", "ct", "mr", "seismic" });
      } },
    { "--array", "NAME", "point array of a .vti, grid of a .vdb (default: the active or first one)",
      [](Options& o, S v) { o.Read.Array = v; } },
    { "--component", "N", "component of colour or vector data (default 0)",
      [](Options& o, S v)
      { o.Read.Component = ParseInteger("--component", v, 0, 1 << 20, "a whole number from 0"); } },
    { "--frame", "N", "frame of a series in time (default 0)",
      [](Options& o, S v)
      { o.Read.Frame = ParseInteger("--frame", v, 0, 1 << 20, "a whole number from 0"); } },
    { "--null", "VALUE",
      "a value that means no data: a wall to light; repeatable (NaN always does)",
      [](Options& o, S v)
      { o.NullValues.push_back(ParseNumber("--null", v, -Infinity, Infinity, "a number")); } },
    { "--z-scale", "F", "SEG-Y: units of world z per ms (default 1)",
      [](Options& o, S v)
      { o.Read.ZScale = ParseNumber("--z-scale", v, 0, 1e6, "a number above 0", true); } },
    { "--inline-byte", "N", "SEG-Y: header byte of the inline number (default 189, else 9, else 5)",
      [](Options& o, S v)
      { o.Read.InlineByte = ParseInteger("--inline-byte", v, 1, 240, "a byte from 1 to 240"); } },
    { "--crossline-byte", "N", "SEG-Y: header byte of the crossline number (default 193, else 21)",
      [](Options& o, S v) {
        o.Read.CrosslineByte = ParseInteger("--crossline-byte", v, 1, 240, "a byte from 1 to 240");
      } },

    { "", "", "Light", {} },
    { "--seed", "x,y,z[,radius[,power]]",
      "a sphere of light in world coordinates (RAS mm where the file says how the patient lies), "
      "or "
      "@i,j,k[,...] in voxels; a negative power takes light away; repeatable. Default radius: two "
      "voxels; power: 1. Without any: a seed in the middle of the widest even region",
      [](Options& o, S v) { o.Seeds.push_back(ParseSeed("--seed", v)); } },
    { "--stroke", "P:P[:P...][:r=R][:p=P]",
      "a painted line of light through points x,y,z or @i,j,k, radius R, power P; repeatable",
      [](Options& o, S v) { o.Strokes.push_back(ParseStroke("--stroke", v)); } },
    { "--paint", "FILE", "a painted source: a volume of signed weights, in any input format",
      [](Options& o, S v) { o.Paint = v; } },
    { "--paint-gain", "F", "power per volume of a weight of 1 (default 1)",
      [](Options& o, S v)
      { o.PaintGain = ParseNumber("--paint-gain", v, -Infinity, Infinity, "a number"); } },

    { "", "", "Where light passes", {} },
    { "--mapping", "NAME",
      "gradient: edges stop light; transfer: --diffusion-tf says where it "
      "passes; transfer-gradient: that function's edges stop it",
      [](Options& o, S v) {
        o.Mapping = ParseChoice("--mapping", v, { "gradient", "transfer", "transfer-gradient" });
      } },
    { "--diffusion-tf", "v:b,...", "how well light passes (0 to 1) by value; default: the opacity",
      [](Options& o, S v) { o.DiffusionCurve = ParseCurve("--diffusion-tf", v, 0, 1, false); } },
    { "--complement", "", "the opposite: light passes where it would not",
      [](Options& o, S) { o.Complement = true; } },
    { "--gradient-scale", "F",
      "edge strength that stops light, value/length; or as in 0.5x: so many "
      "times the strength of the noise's edges that the data shows (default: "
      "the preset's)",
      [](Options& o, S v)
      {
        const bool factor = !v.empty() && v.back() == 'x';
        const double number =
          ParseNumber("--gradient-scale", factor ? v.substr(0, v.size() - 1) : v, 0, Infinity,
            "a number above 0, or one followed by x", true);
        o.GradientScale = factor ? 0. : number;
        o.GradientScaleFactor = factor ? number : -1.;
      } },
    { "--length", "F", "D = beta times this length (default 0: the smallest spacing)",
      [](Options& o, S v)
      { o.Length = ParseNumber("--length", v, 0, Infinity, "a number from 0"); } },
    { "--beta-floor", "F", "beta is at least this (default 1e-6)",
      [](Options& o, S v)
      { o.BetaFloor = ParseNumber("--beta-floor", v, 0, 1, "a number above 0, up to 1", true); } },
    { "--absorption", "NAME",
      "complement: what does not pass is absorbed; albedo; or "
      "value:sigma_a,... in 1/length (default: the preset's)",
      [](Options& o, S v)
      {
        if (v == "complement" || v == "albedo")
        {
          o.Absorption = v;
          return;
        }
        if (v.find(':') == std::string::npos)
        {
          Refuse("--absorption", v, "complement, albedo or value:sigma_a,...");
        }
        o.Absorption = "function";
        o.AbsorptionCurve = ParseCurve("--absorption", v, 0, Infinity, false);
      } },
    { "--albedo", "F", "what is scattered and not absorbed, 0 to 1: sigma_a = (1 - albedo)/(3D)",
      [](Options& o, S v)
      {
        o.Albedo = ParseNumber("--albedo", v, 0, 1, "a number from 0 to 1");
        o.Absorption = "albedo";
      } },
    { "--anisotropy", "F", "mean cosine of scattering, for the albedo (default 0)",
      [](Options& o, S v)
      {
        o.Anisotropy =
          ParseNumber("--anisotropy", v, -.999999, .999999, "a number between -1 and 1");
      } },
    { "--reach", "L",
      "in an open corridor light fades by e over this length; 0: no such absorption "
      "(default: a sixth of the volume's mean width)",
      [](Options& o, S v)
      { o.Reach = ParseNumber("--reach", v, 0, Infinity, "a length from 0"); } },

    { "", "", "Solver", {} },
    { "--model", "NAME",
      "diffusion (default) or anisotropic (Perona-Malik: no absorption, in steps)",
      [](Options& o, S v) {
        o.Model = ParseChoice("--model", v, { "diffusion", "anisotropic" });
      } },
    { "--mode", "NAME", "steady (default), explicit or implicit time steps",
      [](Options& o, S v) {
        o.Mode = ParseChoice("--mode", v, { "steady", "explicit", "implicit" });
      } },
    { "--steps", "N", "time steps (default 100)",
      [](Options& o, S v)
      { o.Steps = ParseInteger("--steps", v, 1, 100000000, "a whole number from 1"); } },
    { "--courant", "F",
      "time step as a fraction of the positivity bound (default: explicit 1, implicit 1000)",
      [](Options& o, S v)
      { o.Courant = ParseNumber("--courant", v, 0, Infinity, "a number above 0", true); } },
    { "--boundary", "NAME",
      "robin (default): light leaves; zeroflux: a mirror; absorbing: none there",
      [](Options& o, S v) {
        o.Boundary = ParseChoice("--boundary", v, { "robin", "zeroflux", "absorbing" });
      } },
    { "--refractive-index", "F", "inside over outside, at a robin boundary (default 1)",
      [](Options& o, S v) {
        o.RefractiveIndex = ParseNumber("--refractive-index", v, 0, 100, "a number above 0", true);
      } },
    { "--tolerance", "F", "relative residual to reach (default 1e-8)",
      [](Options& o, S v) {
        o.Tolerance = ParseNumber("--tolerance", v, 0, .999999, "a number between 0 and 1", true);
      } },
    { "--iterations", "N", "at most (default 500)",
      [](Options& o, S v)
      { o.Iterations = ParseInteger("--iterations", v, 1, 1000000, "a whole number from 1"); } },
    { "--coarsen", "N", "solve on a grid N times coarser; the pictures keep the full volume",
      [](Options& o, S v)
      { o.Coarsen = ParseInteger("--coarsen", v, 1, 64, "a whole number from 1 to 64"); } },

    { "", "", "Pictures", {} },
    { "--view", "NAME", "how lit.png shows the light: overlay (default) or illuminate",
      [](Options& o, S v) {
        o.View = ParseChoice("--view", v, { "overlay", "illuminate" });
      } },
    { "--tf", "v:o[:RRGGBB],...", "opacity (0 to 1) and colour by value (default: the preset's)",
      [](Options& o, S v) { o.TransferFunction = ParseCurve("--tf", v, 0, 1, true); } },
    { "--camera", "AZ,EL[,ZOOM]",
      "degrees from the front, towards the patient's left, and up; or "
      "front, back, left, right, top, bottom (default 35,20)",
      [](Options& o, S v) { o.Camera = ParseCamera("--camera", v); } },
    { "--up", "AXIS", "world axis that points up: z (default), -z, y, -y, x or -x",
      [](Options& o, S v) {
        o.Up = ParseChoice("--up", v, { "z", "-z", "y", "-y", "x", "-x" });
      } },
    { "--size", "WxH", "of a picture in pixels (default 960x720)",
      [](Options& o, S v)
      {
        const std::vector<double> n = ToNumbers(v, 'x');
        if (n.size() != 2 || n[0] != std::floor(n[0]) || n[1] != std::floor(n[1]) ||
          !(n[0] >= 16 && n[0] <= 8192 && n[1] >= 16 && n[1] <= 8192))
        {
          Refuse("--size", v, "WIDTHxHEIGHT, each 16 to 8192");
        }
        o.Size = { { static_cast<int>(n[0]), static_cast<int>(n[1]) } };
      } },
    { "--decades", "F", "of fluence that the colours span (default 6)",
      [](Options& o, S v)
      { o.Decades = ParseNumber("--decades", v, .1, 30, "a number from 0.1 to 30"); } },
    { "--strength", "F", "of the light in the picture, 0 to 1 (default 1)",
      [](Options& o, S v)
      { o.Strength = ParseNumber("--strength", v, 0, 1, "a number from 0 to 1"); } },
    { "--light-opacity", "F", "of the strongest light, 0 to 1",
      [](Options& o, S v)
      { o.LightOpacity = ParseNumber("--light-opacity", v, 0, 1, "a number from 0 to 1"); } },
    { "--tissue-opacity", "F", "factor on the opacity of what is not lit, 0 to 1",
      [](Options& o, S v)
      { o.TissueOpacity = ParseNumber("--tissue-opacity", v, 0, 1, "a number from 0 to 1"); } },
    { "--title", "TEXT", "written in the pictures (default: the file's name)",
      [](Options& o, S v) { o.Title = v; } },
    { "--pictures", "LIST",
      "of plain,lit,slices,flux,arrows,shaded,shadows,environment, or none (default: "
      "plain,lit,slices); flux: colour by the direction in which light flows; arrows: the slices "
      "with it; shaded, shadows, environment: the volume lit from outside, by VTK's own shading, "
      "with shadows, and in a studio: with these alone and --files none nothing is solved",
      [](Options& o, S v)
      {
        o.Pictures = ParseSubset("--pictures", v,
          { "plain", "lit", "slices", "flux", "arrows", "shaded", "shadows", "environment" });
      } },
    { "--key-light", "AZ,EL",
      "where the light of shaded, shadows and environment comes from: degrees to the right of the "
      "viewer, and up (default -40,40)",
      [](Options& o, S v)
      {
        o.KeyLight = ToNumbers(v, ',');
        if (o.KeyLight.size() != 2 || std::abs(o.KeyLight[1]) > 90.)
        {
          Refuse("--key-light", v, "AZ,EL: two numbers, the elevation from -90 to 90");
        }
      } },
    { "--shadow-strength", "F", "how dark shadows are, 0 to 1 (default 0.85)",
      [](Options& o, S v)
      { o.ShadowStrength = ParseNumber("--shadow-strength", v, 0, 1, "a number from 0 to 1"); } },
    { "--no-render", "", "no pictures, no OpenGL", [](Options& o, S) { o.Render = false; } },

    { "", "", "Output", {} },
    { "--out", "DIR", "folder for all files (default light-volume-out)",
      [](Options& o, S v)
      {
        if (v.empty())
        {
          Refuse("--out", v, "the name of a folder");
        }
        o.Out = v;
      } },
    { "--threshold", "F",
      "the lit region is where the fluence is above F times its maximum (default 1e-3)",
      [](Options& o, S v)
      { o.Threshold = ParseNumber("--threshold", v, 0, 1, "a number above 0, up to 1", true); } },
    { "--files", "LIST", "of vti,vdb,nii besides report.json, or none (default: all)",
      [](Options& o, S v) {
        o.Files = ParseSubset("--files", v, { "vti", "vdb", "nii" });
      } },
    { "--quiet", "", "print errors alone", [](Options& o, S) { o.Quiet = true; } },
    { "--help", "", "this text", [](Options& o, S) { o.Help = true; } },
    { "--version", "", "version of the program and of its libraries",
      [](Options& o, S) { o.Version = true; } },
  };
  return table;
}

// Levenshtein's distance.
std::size_t Distance(const std::string& a, const std::string& b)
{
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j)
  {
    row[j] = j;
  }
  for (std::size_t i = 1; i <= a.size(); ++i)
  {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j)
    {
      const std::size_t substituted = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({ row[j] + 1, row[j - 1] + 1, substituted });
    }
  }
  return row[b.size()];
}

std::string Nearest(const std::string& name)
{
  std::string best;
  std::size_t least = 4; // farther than three letters is a guess
  for (const Option& option : Table())
  {
    const std::size_t distance = Distance(name, option.Name);
    if (option.Name[0] && distance < least)
    {
      least = distance;
      best = option.Name;
    }
  }
  return best;
}
} // namespace

Options ParseOptions(const std::vector<std::string>& arguments)
{
  Options options;
  for (std::size_t i = 0; i < arguments.size(); ++i)
  {
    std::string name = arguments[i];
    if (name == "-h")
    {
      name = "--help";
    }
    if (name.compare(0, 2, "--") != 0)
    {
      if (name.size() > 1 && name[0] == '-')
      {
        throw Error("unknown option '" + name + "'; --help lists them");
      }
      if (!options.Input.empty())
      {
        throw Error("two inputs, '" + options.Input + "' and '" + name + "'; expected one");
      }
      options.Input = name;
      continue;
    }
    std::string value;
    const std::size_t equals = name.find('=');
    const bool attached = equals != std::string::npos;
    if (attached)
    {
      value = name.substr(equals + 1);
      name.resize(equals);
    }
    const auto& table = Table();
    const auto option = std::find_if(
      table.begin(), table.end(), [&name](const Option& o) { return o.Name[0] && name == o.Name; });
    if (option == table.end())
    {
      const std::string nearest = Nearest(name);
      throw Error("unknown option '" + name + "'" +
        (nearest.empty() ? "; --help lists them" : "; did you mean " + nearest + "?"));
    }
    if (option->Argument[0] && !attached)
    {
      if (i + 1 >= arguments.size())
      {
        throw Error(name + " has no value; expected " + option->Argument);
      }
      value = arguments[++i];
    }
    else if (!option->Argument[0] && attached)
    {
      throw Error(name + " takes no value, '" + value + "' was given");
    }
    option->Parse(options, value);
    options.Given.emplace_back(name, value);
  }
  if (!options.Help && !options.Version && options.Input.empty())
  {
    throw Error("no input; expected light-volume INPUT [options] (--help lists them)");
  }
  if ((options.Read.InlineByte > 0) != (options.Read.CrosslineByte > 0))
  {
    throw Error("--inline-byte and --crossline-byte go together; only one was given");
  }
  if (options.Mode.empty())
  {
    options.Mode = options.Model == "anisotropic" ? "implicit" : "steady";
  }
  if (options.Model == "anisotropic" && options.Mode == "steady")
  {
    throw Error("--mode is 'steady' with --model anisotropic, which would end in a constant; "
                "expected explicit or implicit");
  }
  if (!(options.Courant > 0.))
  {
    options.Courant = options.Mode == "implicit" ? 1000. : 1.;
  }
  return options;
}

bool Options::NeedsSolve() const
{
  const auto solved = [](const std::string& picture)
  {
    return picture != "plain" && picture != "shaded" && picture != "shadows" &&
      picture != "environment";
  };
  return !this->Render || !this->Files.empty() || this->Pictures.empty() ||
    std::any_of(this->Pictures.begin(), this->Pictures.end(), solved);
}

std::string HelpText()
{
  std::string text =
    "light-volume INPUT [options]\n\n"
    "Lights a structure inside a volume and shows where the light goes.\n"
    "INPUT: NIfTI, MetaImage, NRRD, a DICOM folder, VTI, SEG-Y or OpenVDB.\n"
    "Written to the folder of --out: plain.png, lit.png, slices.png, fluence.vti,\n"
    "fluence.vdb, lit.nii.gz (the lit region, on the input's grid), report.json.\n";
  constexpr std::size_t column = 28;
  constexpr std::size_t width = 92;
  for (const Option& option : Table())
  {
    if (!option.Name[0])
    {
      text += std::string("\n") + option.Help + ":\n";
      continue;
    }
    std::string line =
      std::string("  ") + option.Name + (option.Argument[0] ? " " : "") + option.Argument;
    if (line.size() + 2 > column)
    {
      text += line + "\n";
      line.clear();
    }
    line.resize(column, ' ');
    for (const std::string& word : Words(option.Help))
    {
      if (line.size() + word.size() + 1 > width)
      {
        text += line + "\n";
        line.assign(column - 1, ' ');
      }
      line += (line.back() == ' ' && line.size() == column ? "" : " ") + word;
    }
    text += line + "\n";
  }
  return text;
}

} // namespace lightvolume
