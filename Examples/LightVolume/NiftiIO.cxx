// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "NiftiIO.h"

#include "RawData.h"

#include "vtk_zlib.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>

namespace lightvolume
{
namespace
{
// Reads and writes fields of a header at fixed offsets, in the file's byte order.
class Fields
{
public:
  Fields(const unsigned char* data, bool swap)
    : Data(data)
    , Swap(swap)
  {
  }

  template <typename T>
  T get(std::size_t offset) const
  {
    unsigned char raw[sizeof(T)];
    std::memcpy(raw, this->Data + offset, sizeof(T));
    if (this->Swap)
    {
      std::reverse(raw, raw + sizeof(T));
    }
    T value;
    std::memcpy(&value, raw, sizeof(T));
    return value;
  }

private:
  const unsigned char* Data;
  bool Swap;
};

// What both versions of the header say.
struct Header
{
  bool Swap = false;
  std::vector<std::int64_t> Dim; // of each dimension, dim[0] of them
  double Pixdim[8] = { 0 };
  int DataType = 0;
  std::int64_t Offset = 0;
  double Slope = 0;
  double Intercept = 0;
  int Units = 0;
  int QformCode = 0;
  int SformCode = 0;
  double Quaternion[6] = { 0 }; // b c d, x y z
  double Sform[12] = { 0 };
  bool Pair = false; // the data lies in a file of its own
};

constexpr int Nifti1Size = 348;
constexpr int Nifti2Size = 540;

Header ParseHeader(const Bytes& bytes, const std::string& path)
{
  if (bytes.size() < 4)
  {
    throw Error("'" + path + "' is truncated: " + std::to_string(bytes.size()) +
      " bytes, expected a NIfTI header of 348 or 540");
  }
  Header h;
  std::int32_t size = Fields(bytes.data(), false).get<std::int32_t>(0);
  if (size != Nifti1Size && size != Nifti2Size)
  {
    h.Swap = true;
    size = Fields(bytes.data(), true).get<std::int32_t>(0);
  }
  if (size != Nifti1Size && size != Nifti2Size)
  {
    throw Error("'" + path + "' is not a NIfTI file: its header size is " +
      std::to_string(Fields(bytes.data(), false).get<std::int32_t>(0)) +
      ", expected 348 (NIfTI-1) or 540 (NIfTI-2)");
  }
  if (bytes.size() < static_cast<std::size_t>(size))
  {
    throw Error("'" + path + "' is truncated: " + std::to_string(bytes.size()) +
      " bytes, expected a NIfTI header of " + std::to_string(size));
  }
  const Fields f(bytes.data(), h.Swap);
  const bool two = size == Nifti2Size;
  const char* magic = reinterpret_cast<const char*>(bytes.data()) + (two ? 4 : 344);
  const std::string version = two ? "2" : "1";
  if (std::memcmp(magic, ("n+" + version).c_str(), 4) != 0)
  {
    if (std::memcmp(magic, ("ni" + version).c_str(), 4) != 0)
    {
      throw Error("'" + path + "' is not a NIfTI file: its magic string is neither n+" + version +
        " nor ni" + version + (two ? "" : " (Analyze 7.5 has none, and no orientation)"));
    }
    h.Pair = true;
  }
  const std::int64_t count = two ? f.get<std::int64_t>(16) : f.get<std::int16_t>(40);
  if (count < 1 || count > 7)
  {
    throw Error("'" + path + "' has dim[0] = " + std::to_string(count) + "; expected 1 to 7");
  }
  for (int i = 1; i <= count; ++i)
  {
    h.Dim.push_back(two ? f.get<std::int64_t>(16 + 8 * i) : f.get<std::int16_t>(40 + 2 * i));
  }
  for (int i = 0; i < 8; ++i)
  {
    h.Pixdim[i] = two ? f.get<double>(104 + 8 * i) : f.get<float>(76 + 4 * i);
  }
  if (two)
  {
    h.DataType = f.get<std::int16_t>(12);
    h.Offset = f.get<std::int64_t>(168);
    h.Slope = f.get<double>(176);
    h.Intercept = f.get<double>(184);
    h.QformCode = f.get<std::int32_t>(344);
    h.SformCode = f.get<std::int32_t>(348);
    h.Units = f.get<std::int32_t>(500);
  }
  else
  {
    h.DataType = f.get<std::int16_t>(70);
    h.Offset = static_cast<std::int64_t>(f.get<float>(108));
    h.Slope = f.get<float>(112);
    h.Intercept = f.get<float>(116);
    h.QformCode = f.get<std::int16_t>(252);
    h.SformCode = f.get<std::int16_t>(254);
    h.Units = bytes[123];
  }
  for (int i = 0; i < 6; ++i)
  {
    h.Quaternion[i] = two ? f.get<double>(352 + 8 * i) : f.get<float>(256 + 4 * i);
  }
  for (int i = 0; i < 12; ++i)
  {
    h.Sform[i] = two ? f.get<double>(400 + 8 * i) : f.get<float>(280 + 4 * i);
  }
  if (!h.Pair && h.Offset < size)
  {
    h.Offset = size + 4; // 0 is common; the data then follows header and extension flag
  }
  return h;
}

SampleType ParseType(int code, int& components, const std::string& path)
{
  components = 1;
  switch (code)
  {
    case 2:
      return { SampleType::Unsigned, 1 };
    case 4:
      return { SampleType::Signed, 2 };
    case 8:
      return { SampleType::Signed, 4 };
    case 16:
      return { SampleType::Floating, 4 };
    case 64:
      return { SampleType::Floating, 8 };
    case 128:
      components = 3;
      return { SampleType::Unsigned, 1 };
    case 256:
      return { SampleType::Signed, 1 };
    case 512:
      return { SampleType::Unsigned, 2 };
    case 768:
      return { SampleType::Unsigned, 4 };
    case 1024:
      return { SampleType::Signed, 8 };
    case 1280:
      return { SampleType::Unsigned, 8 };
    case 2304:
      components = 4;
      return { SampleType::Unsigned, 1 };
    default:
      throw Error("'" + path + "' has NIfTI datatype " + std::to_string(code) +
        "; expected integers of 8 to 64 bits, float, double or RGB");
  }
}

// The standard's quaternion to matrix, times pixdim, with qfac on the third column.
Affine QformAffine(const Header& h)
{
  double b = h.Quaternion[0];
  double c = h.Quaternion[1];
  double d = h.Quaternion[2];
  double a = 1. - (b * b + c * c + d * d);
  if (a < 1e-7)
  {
    const double norm = 1. / std::sqrt(b * b + c * c + d * d);
    b *= norm;
    c *= norm;
    d *= norm;
    a = 0.;
  }
  else
  {
    a = std::sqrt(a);
  }
  const double r[9] = { a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c),
    2 * (b * c + a * d), a * a + c * c - b * b - d * d, 2 * (c * d - a * b), 2 * (b * d - a * c),
    2 * (c * d + a * b), a * a + d * d - b * b - c * c };
  const double qfac = h.Pixdim[0] < 0. ? -1. : 1.;
  Affine m = Identity();
  for (int row = 0; row < 3; ++row)
  {
    m[4 * row] = r[3 * row] * h.Pixdim[1];
    m[4 * row + 1] = r[3 * row + 1] * h.Pixdim[2];
    m[4 * row + 2] = r[3 * row + 2] * h.Pixdim[3] * qfac;
    m[4 * row + 3] = h.Quaternion[3 + row];
  }
  return m;
}

bool EndsWith(const std::string& text, const std::string& end)
{
  return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

// The file that holds the voxels of a .hdr.
std::string PairedFile(const std::string& path)
{
  std::string stem = path;
  for (const char* end : { ".hdr.gz", ".hdr" })
  {
    if (EndsWith(LowerCase(stem), end))
    {
      stem.resize(stem.size() - std::strlen(end));
      break;
    }
  }
  for (const char* end : { ".img", ".img.gz", ".IMG" })
  {
    if (std::ifstream(stem + end).good())
    {
      return stem + end;
    }
  }
  throw Error("'" + path + "' is a NIfTI header whose data file '" + stem + ".img' is missing");
}
} // namespace

Volume ReadNifti(const std::string& path, int frame, int component)
{
  constexpr std::uint64_t headerLimit = Nifti2Size;
  Bytes bytes = ReadBytes(path);
  const bool zipped = IsGzip(bytes);
  const Header h = ParseHeader(zipped ? Inflate(bytes, path, headerLimit) : bytes, path);

  Volume volume;
  volume.Format = "NIfTI";
  int components = 1;
  const SampleType type = ParseType(h.DataType, components, path);
  std::array<int, 3> dims = { { 1, 1, 1 } };
  std::int64_t frames = 1;
  for (std::size_t i = 0; i < h.Dim.size(); ++i)
  {
    if (h.Dim[i] < 1 || h.Dim[i] > 2147483647)
    {
      throw Error("'" + path + "' has dim[" + std::to_string(i + 1) +
        "] = " + std::to_string(h.Dim[i]) + "; expected at least 1");
    }
    if (i < 3)
    {
      dims[i] = static_cast<int>(h.Dim[i]);
    }
    else
    {
      frames *= h.Dim[i];
    }
  }
  const std::uint64_t voxels = CheckDimensions(dims, path);
  if (frame < 0 || frame >= frames)
  {
    throw Error("--frame is " + std::to_string(frame) + "; '" + path + "' has frames 0 to " +
      std::to_string(frames - 1));
  }
  if (frames > 1)
  {
    volume.Notes.push_back("frame " + std::to_string(frame) + " of " + std::to_string(frames) +
      " (--frame chooses another)");
  }
  if (component < 0 || component >= components)
  {
    throw Error("--component is " + std::to_string(component) + "; '" + path +
      "' has components 0 to " + std::to_string(components - 1));
  }
  if (components > 1)
  {
    volume.Notes.push_back("component " + std::to_string(component) + " of " +
      std::to_string(components) + " (--component chooses another)");
  }

  double slope = h.Slope;
  double intercept = h.Intercept;
  if (slope == 0. || !std::isfinite(slope) || !std::isfinite(intercept) || components > 1)
  {
    slope = 1.; // the standard: no scaling
    intercept = 0.;
  }
  if (slope != 1. || intercept != 0.)
  {
    volume.Notes.push_back(
      "values rescaled by " + FormatNumber(slope) + " and " + FormatNumber(intercept));
  }

  std::uint64_t offset = h.Offset < 0 ? 0 : static_cast<std::uint64_t>(h.Offset);
  const std::string dataPath = h.Pair ? PairedFile(path) : path;
  if (h.Pair)
  {
    bytes = ReadBytes(dataPath);
  }
  Selection selection;
  selection.Stride = static_cast<std::uint64_t>(components);
  selection.Start = static_cast<std::uint64_t>(frame) * voxels * selection.Stride + component;
  const std::uint64_t end =
    offset + (static_cast<std::uint64_t>(frame) + 1) * voxels * selection.Stride * type.Size;
  if (IsGzip(bytes))
  {
    bytes = Inflate(bytes, dataPath, end);
  }
#ifdef VTK_WORDS_BIGENDIAN
  const bool bigEndian = !h.Swap;
#else
  const bool bigEndian = h.Swap;
#endif
  volume.Image =
    MakeImage(dims, bytes, offset, type, bigEndian, selection, slope, intercept, dataPath);

  // Where it lies.
  double pixdim[3];
  Affine stored = Identity();
  for (int a = 0; a < 3; ++a)
  {
    pixdim[a] = h.Pixdim[a + 1];
    // The missing dimensions of a plane or a line carry no spacing.
    if (a >= static_cast<int>(h.Dim.size()) && !(pixdim[a] > 0.))
    {
      pixdim[a] = 1.;
    }
    stored[5 * a] = pixdim[a];
  }
  volume.IsRAS = h.SformCode > 0 || h.QformCode > 0;
  std::vector<Affine> candidates; // best first
  if (h.SformCode > 0)
  {
    Affine sform = Identity();
    std::copy(h.Sform, h.Sform + 12, sform.begin());
    candidates.push_back(sform);
  }
  if (h.QformCode > 0)
  {
    Header fixed = h;
    std::copy(pixdim, pixdim + 3, fixed.Pixdim + 1);
    candidates.push_back(QformAffine(fixed));
  }
  if (candidates.empty())
  {
    volume.Notes.push_back("neither sform nor qform: world is spacing times index, not RAS");
    candidates.push_back(stored);
  }
  double scale = 1.;
  switch (h.Units & 7)
  {
    case 1:
      scale = 1000.;
      volume.Notes.push_back("metres converted to mm");
      break;
    case 3:
      scale = .001;
      volume.Notes.push_back("micrometres converted to mm");
      break;
    default:
      break; // mm, or unknown, which in practice means mm
  }
  volume.Unit = "mm";
  std::string refused;
  for (Affine& m : candidates)
  {
    for (int i = 0; i < 12; ++i)
    {
      m[i] *= scale;
    }
    try
    {
      Place(volume, m);
    }
    catch (const Error& error)
    {
      refused = refused.empty() ? error.what() : refused;
      continue;
    }
    if (!refused.empty())
    {
      volume.Notes.push_back("the qform is used: in the sform " + refused);
    }
    return volume;
  }
  throw Error("'" + path + "': " + refused);
}

void WriteNiftiLabels(const std::string& path, const Volume& volume,
  const std::vector<std::uint8_t>& labels, const std::string& description)
{
  const auto& dims = volume.Dimensions;
  for (int d : dims)
  {
    if (d > 32767)
    {
      throw Error("'" + path + "': NIfTI-1 holds at most 32767 voxels along an axis, this has " +
        std::to_string(d));
    }
  }
  unsigned char header[352] = { 0 };
  const auto put = [&header](std::size_t offset, auto value)
  { std::memcpy(header + offset, &value, sizeof value); };
  put(0, std::int32_t(Nifti1Size));
  const std::int16_t dim[8] = { 3, static_cast<std::int16_t>(dims[0]),
    static_cast<std::int16_t>(dims[1]), static_cast<std::int16_t>(dims[2]), 1, 1, 1, 1 };
  const Affine& m = volume.FileToWorld;
  float pixdim[8] = { 1, 1, 1, 1, 1, 1, 1, 1 };
  double r[3][3]; // rotation, columns
  for (int a = 0; a < 3; ++a)
  {
    const double length = std::sqrt(m[a] * m[a] + m[4 + a] * m[4 + a] + m[8 + a] * m[8 + a]);
    pixdim[a + 1] = static_cast<float>(length);
    for (int row = 0; row < 3; ++row)
    {
      r[row][a] = m[4 * row + a] / length;
    }
  }
  const double determinant = r[0][0] * (r[1][1] * r[2][2] - r[1][2] * r[2][1]) -
    r[0][1] * (r[1][0] * r[2][2] - r[1][2] * r[2][0]) +
    r[0][2] * (r[1][0] * r[2][1] - r[1][1] * r[2][0]);
  if (determinant < 0.)
  {
    pixdim[0] = -1.F; // qfac
    for (auto& row : r)
    {
      row[2] = -row[2];
    }
  }
  // Rotation to quaternion by its largest component, with a >= 0.
  const double trace[4] = { r[0][0] + r[1][1] + r[2][2], r[0][0] - r[1][1] - r[2][2],
    r[1][1] - r[0][0] - r[2][2], r[2][2] - r[0][0] - r[1][1] };
  const int largest = static_cast<int>(std::max_element(trace, trace + 4) - trace);
  double q[4];
  q[largest] = .5 * std::sqrt(std::max(0., 1. + trace[largest]));
  const double s = .25 / q[largest];
  const double ab = (r[2][1] - r[1][2]) * s;
  const double ac = (r[0][2] - r[2][0]) * s;
  const double ad = (r[1][0] - r[0][1]) * s;
  const double bc = (r[1][0] + r[0][1]) * s;
  const double bd = (r[0][2] + r[2][0]) * s;
  const double cd = (r[2][1] + r[1][2]) * s;
  const double table[4][4] = { { 0, ab, ac, ad }, { ab, 0, bc, bd }, { ac, bc, 0, cd },
    { ad, bd, cd, 0 } };
  for (int i = 0; i < 4; ++i)
  {
    if (i != largest)
    {
      q[i] = table[largest][i];
    }
  }
  const double sign = q[0] < 0. ? -1. : 1.;
  for (int i = 0; i < 8; ++i)
  {
    put(40 + 2 * i, dim[i]);
    put(76 + 4 * i, pixdim[i]);
  }
  put(70, std::int16_t(2)); // unsigned char
  put(72, std::int16_t(8));
  put(108, 352.F);
  put(112, 1.F);
  header[123] = 2; // mm
  put(124, 1.F);   // cal_max
  // 80 characters, the last of them 0
  std::copy_n(description.begin(), std::min<std::size_t>(description.size(), 79), header + 148);
  const std::int16_t code = volume.IsRAS ? 1 : 2; // scanner, or aligned to something else
  put(252, code);
  put(254, code);
  for (int i = 0; i < 3; ++i)
  {
    put(256 + 4 * i, static_cast<float>(sign * q[i + 1]));
    put(268 + 4 * i, static_cast<float>(m[4 * i + 3]));
  }
  for (int i = 0; i < 12; ++i)
  {
    put(280 + 4 * i, static_cast<float>(m[i]));
  }
  std::memcpy(header + 344, "n+1", 4);

  // Back to the file's voxel order.
  std::vector<std::uint8_t> ordered(labels.size());
  std::size_t n = 0;
  for (int k = 0; k < dims[2]; ++k)
  {
    const std::size_t kk = volume.Flipped[2] ? dims[2] - 1 - k : k;
    for (int j = 0; j < dims[1]; ++j)
    {
      const std::size_t jj = volume.Flipped[1] ? dims[1] - 1 - j : j;
      for (int i = 0; i < dims[0]; ++i)
      {
        const std::size_t ii = volume.Flipped[0] ? dims[0] - 1 - i : i;
        ordered[n++] = labels[ii + dims[0] * (jj + dims[1] * kk)];
      }
    }
  }
  // "wbT" writes without compression.
  gzFile file = gzopen(path.c_str(), EndsWith(path, ".gz") ? "wb6" : "wbT");
  bool ok = file != nullptr;
  if (ok)
  {
    ok = gzwrite(file, header, sizeof header) == static_cast<int>(sizeof header);
    constexpr std::size_t piece = 1U << 24;
    for (std::size_t at = 0; ok && at < ordered.size(); at += piece)
    {
      const auto bytes = static_cast<unsigned int>(std::min(piece, ordered.size() - at));
      ok = gzwrite(file, ordered.data() + at, bytes) == static_cast<int>(bytes);
    }
    ok = gzclose(file) == Z_OK && ok;
  }
  if (!ok)
  {
    throw Error("cannot write '" + path + "'");
  }
}

} // namespace lightvolume
