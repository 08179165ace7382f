// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * light-volume's readers and writers: a marked voxel of tiny files written here, byte by byte,
 * must lie where each format says, with the value it says; damaged files give one clear error.
 */
#include "LightTransportTesting.h"

#include "NiftiIO.h"
#include "RawData.h"
#include "VdbIO.h"
#include "VolumeReader.h"

#include "vtkCellData.h"
#include "vtkFloatArray.h"
#include "vtkImageData.h"
#include "vtkMath.h"
#include "vtkMatrix3x3.h"
#include "vtkNew.h"
#include "vtkPointData.h"
#include "vtkUnsignedCharArray.h"
#include "vtkXMLImageDataWriter.h"
#include "vtk_zlib.h"

#ifdef LIGHTVOLUME_DICOM
#include "vtkDICOMCTGenerator.h"
#include "vtkDICOMMetaData.h"
#include "vtkDICOMWriter.h"
#include "vtkMatrix4x4.h"
#endif

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <limits>
#include <map>

#include <sys/stat.h>

using namespace lightvolume;
using lighttransport::testing::Suite;

namespace
{
using Vec = std::array<double, 3>;

constexpr int Dims[3] = { 5, 4, 3 };
constexpr int Mark[3] = { 3, 1, 2 };

// 0, 1, 2 ... with 100 at the marked voxel.
std::vector<double> Values()
{
  std::vector<double> values(Dims[0] * Dims[1] * Dims[2]);
  for (std::size_t i = 0; i < values.size(); ++i)
  {
    values[i] = static_cast<double>(i % 50);
  }
  values[Mark[0] + Dims[0] * (Mark[1] + Dims[1] * Mark[2])] = 100.;
  return values;
}

template <typename T>
void Append(Bytes& bytes, T value, bool bigEndian = false)
{
  unsigned char raw[sizeof(T)];
  std::memcpy(raw, &value, sizeof(T));
  if (bigEndian)
  {
    std::reverse(raw, raw + sizeof(T));
  }
  bytes.insert(bytes.end(), raw, raw + sizeof(T));
}

template <typename T>
void Put(Bytes& bytes, std::size_t offset, T value, bool bigEndian = false)
{
  Bytes raw;
  Append(raw, value, bigEndian);
  std::copy(raw.begin(), raw.end(), bytes.begin() + static_cast<std::ptrdiff_t>(offset));
}

template <typename T>
Bytes Samples(bool bigEndian = false)
{
  Bytes bytes;
  for (const double v : Values())
  {
    Append(bytes, static_cast<T>(v), bigEndian);
  }
  return bytes;
}

void Save(const std::string& path, const Bytes& bytes)
{
  std::ofstream file(path, std::ios::binary);
  file.write(
    reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
}

void Save(const std::string& path, const std::string& text, const Bytes& bytes = {})
{
  Bytes all(text.begin(), text.end());
  all.insert(all.end(), bytes.begin(), bytes.end());
  Save(path, all);
}

Bytes Gzip(const Bytes& bytes)
{
  z_stream stream;
  std::memset(&stream, 0, sizeof stream);
  deflateInit2(&stream, 6, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY);
  Bytes out(deflateBound(&stream, static_cast<uLong>(bytes.size())) + 64);
  stream.next_in = const_cast<unsigned char*>(bytes.data());
  stream.avail_in = static_cast<unsigned int>(bytes.size());
  stream.next_out = out.data();
  stream.avail_out = static_cast<unsigned int>(out.size());
  deflate(&stream, Z_FINISH);
  out.resize(stream.total_out);
  deflateEnd(&stream);
  return out;
}

// World position and value of the brightest voxel, by VTK's own geometry.
Vec Brightest(const Volume& volume, double* value = nullptr)
{
  vtkDataArray* scalars = volume.Image->GetPointData()->GetScalars();
  vtkIdType best = 0;
  for (vtkIdType i = 0; i < scalars->GetNumberOfTuples(); ++i)
  {
    const double v = scalars->GetComponent(i, 0);
    if (!(v <= scalars->GetComponent(best, 0)) && !std::isnan(v))
    {
      best = i;
    }
  }
  if (value)
  {
    *value = scalars->GetComponent(best, 0);
  }
  Vec p;
  volume.Image->GetPoint(best, p.data());
  return p;
}

void CheckPoint(Suite& suite, const Vec& p, const Vec& expected, const std::string& what, int line)
{
  bool near = true;
  for (int a = 0; a < 3; ++a)
  {
    near = near && std::abs(p[a] - expected[a]) <= 1e-4;
  }
  suite.check(near,
    what + ": " + FormatPoint(p.data()) + ", expected " + FormatPoint(expected.data()), __FILE__,
    line);
}

// The image, the volume's own arithmetic, and the expected point agree.
void CheckVolume(
  Suite& suite, const Volume& volume, const Vec& expected, double value, const char* what, int line)
{
  double brightest = 0.;
  CheckPoint(suite, Brightest(volume, &brightest), expected, what, line);
  CheckPoint(suite,
    volume.World(Mark[0] + volume.FirstIndex[0], Mark[1] + volume.FirstIndex[1],
      Mark[2] + volume.FirstIndex[2]),
    expected, std::string(what) + " (file voxel to world)", line);
  const Vec voxel = volume.Voxel(expected);
  CheckPoint(suite, voxel,
    { { double(Mark[0] + volume.FirstIndex[0]), double(Mark[1] + volume.FirstIndex[1]),
      double(Mark[2] + volume.FirstIndex[2]) } },
    std::string(what) + " (world to file voxel)", line);
  suite.check(std::abs(brightest - value) < 1e-4,
    std::string(what) + ": value " + std::to_string(brightest) + ", expected " +
      std::to_string(value),
    __FILE__, line);
  suite.check(volume.Image->GetDirectionMatrix()->Determinant() > 0.,
    std::string(what) + ": a right-handed image", __FILE__, line);
}
#define CHECK_VOLUME(volume, expected, value, what)                                                \
  CheckVolume(suite, volume, expected, value, what, __LINE__)

// Fails with one line that holds both words.
void CheckError(Suite& suite, const std::string& path, const std::string& first,
  const std::string& second, int line, const ReadOptions& options = {})
{
  std::string message = "no error";
  try
  {
    ReadVolume(path, options);
  }
  catch (const Error& error)
  {
    message = error.what();
  }
  suite.check(message.find(first) != std::string::npos &&
      message.find(second) != std::string::npos && message.find('\n') == std::string::npos,
    path + ": '" + message + "' should say '" + first + "' and '" + second + "'", __FILE__, line);
}
#define CHECK_ERROR(path, first, second) CheckError(suite, path, first, second, __LINE__)

struct NiftiHeader
{
  int SformCode = 0;
  int QformCode = 0;
  std::array<double, 12> Sform = { { 0 } };
  std::array<double, 6> Quaternion = { { 0 } };
  double Qfac = 1.;
  Vec Pixdim = { { 1, 1, 1 } };
  int Type = 4;
  double Slope = 0.;
  double Intercept = 0.;
  int Units = 2;
  int Frames = 1;
  const char* Magic = "n+1";
};

Bytes Nifti1(const NiftiHeader& h, bool big = false)
{
  Bytes b(352, 0);
  Put(b, 0, std::int32_t(348), big);
  const int dim[8] = { h.Frames > 1 ? 4 : 3, Dims[0], Dims[1], Dims[2], h.Frames, 1, 1, 1 };
  const double pixdim[8] = { h.Qfac, h.Pixdim[0], h.Pixdim[1], h.Pixdim[2], 1, 1, 1, 1 };
  const std::map<int, int> bits = { { 2, 8 }, { 4, 16 }, { 8, 32 }, { 16, 32 }, { 64, 64 } };
  for (int i = 0; i < 8; ++i)
  {
    Put(b, 40 + 2 * i, static_cast<std::int16_t>(dim[i]), big);
    Put(b, 76 + 4 * i, static_cast<float>(pixdim[i]), big);
  }
  Put(b, 70, static_cast<std::int16_t>(h.Type), big);
  Put(b, 72, static_cast<std::int16_t>(bits.at(h.Type)), big);
  Put(b, 108, h.Magic[1] == '+' ? 352.F : 0.F, big);
  Put(b, 112, static_cast<float>(h.Slope), big);
  Put(b, 116, static_cast<float>(h.Intercept), big);
  b[123] = static_cast<unsigned char>(h.Units);
  Put(b, 252, static_cast<std::int16_t>(h.QformCode), big);
  Put(b, 254, static_cast<std::int16_t>(h.SformCode), big);
  for (int i = 0; i < 6; ++i)
  {
    Put(b, 256 + 4 * i, static_cast<float>(h.Quaternion[i]), big);
  }
  for (int i = 0; i < 12; ++i)
  {
    Put(b, 280 + 4 * i, static_cast<float>(h.Sform[i]), big);
  }
  std::memcpy(b.data() + 344, h.Magic, 4);
  return b;
}

Bytes Join(Bytes a, const Bytes& b)
{
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

// Columns: 2 along y, 3 along z, 4 along x; origin (10, 20, 30): an axis permutation.
constexpr std::array<double, 12> Permuted = { { 0, 0, 4, 10, 2, 0, 0, 20, 0, 3, 0, 30 } };
const Vec PermutedMark = { { 10. + 4 * Mark[2], 20. + 2 * Mark[0], 30. + 3 * Mark[1] } };

void TestNifti(Suite& suite, const std::string& folder)
{
  NiftiHeader h;
  h.SformCode = 1;
  h.Sform = Permuted;
  Save(folder + "permuted.nii", Join(Nifti1(h), Samples<std::int16_t>()));
  Volume v = ReadVolume(folder + "permuted.nii", {});
  CHECK_VOLUME(v, PermutedMark, 100., "NIfTI sform, axes permuted");
  LT_CHECK(suite, v.IsRAS);
  LT_CHECK(suite, v.Image->GetScalarType() == VTK_SHORT);
  LT_CHECK_NEAR(suite, v.Image->GetSpacing()[0], 2., 1e-6);
  LT_CHECK_NEAR(suite, v.Image->GetSpacing()[2], 4., 1e-6);

  // 30 degrees about z, mirrored in x (radiological order): left-handed.
  const double c = std::cos(vtkMath::RadiansFromDegrees(30.));
  const double s = .5;
  h.Sform = { { -2 * c, -3 * s, 0, 7, -2 * s, 3 * c, 0, -8, 0, 0, 4, 9 } };
  Save(folder + "oblique.nii.gz", Gzip(Join(Nifti1(h), Samples<std::int16_t>())));
  v = ReadVolume(folder + "oblique.nii.gz", {});
  CHECK_VOLUME(v,
    (Vec{ { 7 - 2 * c * Mark[0] - 3 * s * Mark[1], -8 - 2 * s * Mark[0] + 3 * c * Mark[1],
      9. + 4 * Mark[2] } }),
    100., "NIfTI sform, oblique and left-handed");
  LT_CHECK(suite, v.Flipped[0] && !v.Flipped[1] && !v.Flipped[2]);

  // The labels come back in the file's own order, under the file's affine.
  std::vector<std::uint8_t> labels(v.Image->GetNumberOfPoints(), 0);
  for (vtkIdType i = 0; i < v.Image->GetNumberOfPoints(); ++i)
  {
    labels[i] = v.Image->GetPointData()->GetScalars()->GetComponent(i, 0) == 100. ? 1 : 0;
  }
  WriteNiftiLabels(folder + "labels.nii.gz", v, labels, "test");
  const Volume back = ReadVolume(folder + "labels.nii.gz", {});
  CHECK_VOLUME(back, Brightest(v), 1., "labels on the input's grid");
  for (int i = 0; i < 12; ++i)
  {
    LT_CHECK_NEAR(suite, back.FileToWorld[i], v.FileToWorld[i], 1e-5);
  }
  // The qform says the same as the sform: blank the sform's code and read again.
  Bytes bytes = Inflate(ReadBytes(folder + "labels.nii.gz"), "labels", 1 << 20);
  Put(bytes, 254, std::int16_t(0));
  Save(folder + "labels-qform.nii", bytes);
  CHECK_VOLUME(
    ReadVolume(folder + "labels-qform.nii", {}), Brightest(v), 1., "qform of the labels");

  // qform: 180 degrees about z is the quaternion (0; 0, 0, 1); qfac -1 mirrors k. Big-endian,
  // with rescaling, in micrometres.
  NiftiHeader q;
  q.QformCode = 1;
  q.Quaternion = { { 0, 0, 1, 5000, 6000, 7000 } };
  q.Qfac = -1.;
  q.Pixdim = { { 2000, 3000, 4000 } };
  q.Units = 3;
  q.Slope = .5;
  q.Intercept = -10.;
  q.Type = 16;
  Save(folder + "qform.nii", Join(Nifti1(q, true), Samples<float>(true)));
  v = ReadVolume(folder + "qform.nii", {});
  CHECK_VOLUME(v, (Vec{ { 5. - 2 * Mark[0], 6. - 3 * Mark[1], 7. - 4 * Mark[2] } }), 40.,
    "NIfTI qform, big-endian, rescaled, micrometres");
  LT_CHECK(suite, v.Unit == "mm");

  // A sheared sform: the qform is used; without one, refused.
  NiftiHeader sheared = q;
  sheared.SformCode = 1;
  sheared.Sform = { { 2, 1, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0 } };
  sheared.Units = 2;
  sheared.Quaternion = { { 0, 0, 0, 1, 2, 3 } };
  sheared.Qfac = 1.;
  sheared.Pixdim = { { 1, 1, 1 } };
  Save(folder + "sheared.nii", Join(Nifti1(sheared), Samples<float>()));
  CHECK_VOLUME(ReadVolume(folder + "sheared.nii", {}),
    (Vec{ { 1. + Mark[0], 2. + Mark[1], 3. + Mark[2] } }), 40., "sheared sform, good qform");
  sheared.QformCode = 0;
  Save(folder + "sheared-alone.nii", Join(Nifti1(sheared), Samples<float>()));
  CHECK_ERROR(folder + "sheared-alone.nii", "sheared", "90 +- 5");

  // Neither: no RAS is claimed. Two frames; the second is the marked one.
  NiftiHeader plain;
  plain.Frames = 2;
  plain.Type = 2;
  plain.Pixdim = { { 1, 2, 3 } };
  const Bytes blank(Samples<std::uint8_t>().size(), 0);
  Save(folder + "frames.nii", Join(Join(Nifti1(plain), blank), Samples<std::uint8_t>()));
  ReadOptions second;
  second.Frame = 1;
  v = ReadVolume(folder + "frames.nii", second);
  CHECK_VOLUME(v, (Vec{ { 1. * Mark[0], 2. * Mark[1], 3. * Mark[2] } }), 100., "second frame");
  LT_CHECK(suite, !v.IsRAS);
  second.Frame = 2;
  CheckError(suite, folder + "frames.nii", "--frame is 2", "0 to 1", __LINE__, second);

  // .hdr and .img.
  NiftiHeader pair = h;
  pair.Magic = "ni1";
  pair.Sform = Permuted;
  Save(folder + "pair.hdr", Nifti1(pair));
  Save(folder + "pair.img", Samples<std::int16_t>());
  CHECK_VOLUME(ReadVolume(folder + "pair.hdr", {}), PermutedMark, 100., "NIfTI pair");
  Save(folder + "widow.hdr", Nifti1(pair));
  CHECK_ERROR(folder + "widow.hdr", "widow.img", "missing");

  // NIfTI-2, int64 to double.
  Bytes two(544, 0);
  Put(two, 0, std::int32_t(540));
  std::memcpy(two.data() + 4, "n+2\0\r\n\032\n", 8);
  Put(two, 12, std::int16_t(1024));
  const std::int64_t dim2[4] = { 3, Dims[0], Dims[1], Dims[2] };
  for (int i = 0; i < 4; ++i)
  {
    Put(two, 16 + 8 * i, dim2[i]);
    Put(two, 104 + 8 * i, 1.);
  }
  Put(two, 168, std::int64_t(544));
  Put(two, 348, std::int32_t(1));
  for (int i = 0; i < 12; ++i)
  {
    Put(two, 400 + 8 * i, Permuted[i]);
  }
  Save(folder + "two.nii", Join(two, Samples<std::int64_t>()));
  CHECK_VOLUME(ReadVolume(folder + "two.nii", {}), PermutedMark, 100., "NIfTI-2");

  // Damage.
  h.Sform = Permuted;
  const Bytes good = Join(Nifti1(h), Samples<std::int16_t>());
  Save(folder + "short.nii", Bytes(good.begin(), good.end() - 7));
  CHECK_ERROR(folder + "short.nii", "truncated", "472");
  const Bytes zipped = Gzip(good);
  Save(folder + "short.nii.gz", Bytes(zipped.begin(), zipped.end() - 20));
  CHECK_ERROR(folder + "short.nii.gz", "truncated", "short.nii.gz");
  Bytes bad = good;
  Put(bad, 0, std::int32_t(347));
  Save(folder + "size.nii", bad);
  CHECK_ERROR(folder + "size.nii", "header size is 347", "348");
  bad = good;
  Put(bad, 42, std::int16_t(-5));
  Save(folder + "dim.nii", bad);
  CHECK_ERROR(folder + "dim.nii", "dim[1] = -5", "at least 1");
  bad = good;
  for (int i = 0; i < 12; i += 4)
  {
    Put(bad, 280 + 4 * i, 0.F);
  }
  Save(folder + "zero.nii", bad);
  CHECK_ERROR(folder + "zero.nii", "spacing along axis 0 is 0", "positive");
  bad = good;
  Put(bad, 280, std::numeric_limits<float>::quiet_NaN());
  Save(folder + "nan.nii", bad);
  CHECK_ERROR(folder + "nan.nii", "nan", "positive");
  bad = good;
  Put(bad, 70, std::int16_t(32));
  Save(folder + "complex.nii", bad);
  CHECK_ERROR(folder + "complex.nii", "datatype 32", "expected");
  NiftiHeader f = h;
  f.Type = 16;
  Bytes floats = Join(Nifti1(f), Samples<float>());
  Put(floats, 352 + 4 * (2 + Dims[0]), std::numeric_limits<float>::infinity());
  Save(folder + "infinite.nii", floats);
  CHECK_ERROR(folder + "infinite.nii", "infinite", "(2, 1, 0)");
  Save(folder + "empty.nii", Bytes());
  CHECK_ERROR(folder + "empty.nii", "is empty", "empty.nii");
  CHECK_ERROR(folder + "absent.nii", "cannot open", "No such file");
  Save(folder + "what.txt", good);
  CHECK_ERROR(folder + "what.txt", ".txt", ".nii.gz");
}

void TestMetaImage(Suite& suite, const std::string& folder)
{
  // Axis 0 along y, axis 1 along z, axis 2 along x, in LPS.
  const std::string head = "ObjectType = Image\nNDims = 3\nBinaryData = True\n"
                           "BinaryDataByteOrderMSB = False\n";
  const std::string place = "TransformMatrix = 0 1 0 0 0 1 1 0 0\nOffset = 10 20 30\n"
                            "ElementSpacing = 2 3 4\nDimSize = 5 4 3\n";
  const Vec expected = { { -PermutedMark[0], -PermutedMark[1], PermutedMark[2] } };
  Save(folder + "local.mha",
    head + "CompressedData = False\n" + place +
      "ElementType = MET_USHORT\nElementDataFile = LOCAL\n",
    Samples<std::uint16_t>());
  Volume v = ReadVolume(folder + "local.mha", {});
  CHECK_VOLUME(v, expected, 100., "MHA, LPS to RAS");
  LT_CHECK(suite, v.IsRAS);
  LT_CHECK(suite,
    std::any_of(v.Notes.begin(), v.Notes.end(),
      [](const std::string& note) { return note.find("LPS") != std::string::npos; }));

  // zlib, big-endian, in a file of its own.
  const Bytes raw = Samples<float>(true);
  Bytes packed(compressBound(static_cast<uLong>(raw.size())));
  auto size = static_cast<uLongf>(packed.size());
  compress(packed.data(), &size, raw.data(), static_cast<uLong>(raw.size()));
  packed.resize(size);
  Save(folder + "apart.zraw", packed);
  Save(folder + "apart.mhd",
    "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = True\n"
    "CompressedData = True\n" +
      place + "ElementType = MET_FLOAT\nElementDataFile = apart.zraw\n");
  CHECK_VOLUME(ReadVolume(folder + "apart.mhd", {}), expected, 100., "MHD, compressed, big-endian");

  // Slice by slice, and one component of two.
  const Bytes shorts = Samples<std::int16_t>();
  const std::size_t slice = shorts.size() / Dims[2];
  for (int k = 0; k < Dims[2]; ++k)
  {
    Save(folder + "slice" + std::to_string(k) + ".raw",
      Bytes(shorts.begin() + static_cast<std::ptrdiff_t>(k * slice),
        shorts.begin() + static_cast<std::ptrdiff_t>((k + 1) * slice)));
  }
  Save(folder + "list.mhd",
    head + place +
      "ElementType = MET_SHORT\nElementDataFile = LIST\nslice0.raw\nslice1.raw\nslice2.raw\n");
  CHECK_VOLUME(ReadVolume(folder + "list.mhd", {}), expected, 100., "MHD, list of slices");
  Save(folder + "pattern.mhd",
    head + place + "ElementType = MET_SHORT\nElementDataFile = slice%01d.raw 0 2 1\n");
  CHECK_VOLUME(ReadVolume(folder + "pattern.mhd", {}), expected, 100., "MHD, pattern of slices");
  Bytes pairs;
  for (const double value : Values())
  {
    Append(pairs, std::uint8_t(255));
    Append(pairs, static_cast<std::uint8_t>(value));
  }
  Save(folder + "pairs.mha",
    head + place +
      "ElementNumberOfChannels = 2\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n",
    pairs);
  ReadOptions second;
  second.Component = 1;
  CHECK_VOLUME(ReadVolume(folder + "pairs.mha", second), expected, 100., "MHA, second component");

  Save(folder + "short.mha", head + place + "ElementType = MET_USHORT\nElementDataFile = LOCAL\n",
    Bytes(shorts.begin(), shorts.end() - 1));
  CHECK_ERROR(folder + "short.mha", "truncated", "119 bytes");
  Save(
    folder + "lost.mhd", head + place + "ElementType = MET_USHORT\nElementDataFile = lost.raw\n");
  CHECK_ERROR(folder + "lost.mhd", "lost.raw", "No such file");
  Save(folder + "none.mha", "not a header at all\n");
  CHECK_ERROR(folder + "none.mha", "not a MetaImage", "DimSize");
}

void TestNrrd(Suite& suite, const std::string& folder)
{
  const std::string place = "sizes: 5 4 3\nspace directions: (0,2,0) (0,0,3) (4,0,0)\n"
                            "space origin: (10,20,30)\nendian: big\n";
  const Vec expected = { { -PermutedMark[0], -PermutedMark[1], PermutedMark[2] } };
  Save(folder + "lps.nrrd",
    "NRRD0004\n# comment\ntype: short\ndimension: 3\nspace: left-posterior-superior\n" + place +
      "encoding: raw\nkey:=value\n\n",
    Samples<std::int16_t>(true));
  Volume v = ReadVolume(folder + "lps.nrrd", {});
  CHECK_VOLUME(v, expected, 100., "NRRD, LPS to RAS");
  LT_CHECK(suite, v.IsRAS);
  Save(folder + "ras.raw.gz", Gzip(Samples<double>(true)));
  Save(folder + "ras.nhdr",
    "NRRD0005\ntype: double\ndimension: 3\nspace: RAS\n" + place +
      "encoding: gzip\ndata file: ras.raw.gz\n");
  CHECK_VOLUME(ReadVolume(folder + "ras.nhdr", {}), PermutedMark, 100., "NHDR, RAS, gzip");
  Save(folder + "las.nrrd",
    "NRRD0005\ntype: uchar\ndimension: 3\nspace: LAS\n" + place + "encoding: raw\n\n",
    Samples<std::uint8_t>());
  CHECK_VOLUME(ReadVolume(folder + "las.nrrd", {}),
    (Vec{ { -PermutedMark[0], PermutedMark[1], PermutedMark[2] } }), 100., "NRRD, LAS to RAS");

  // Colours first; no directions: spacings, and no RAS.
  Bytes triples;
  for (const double value : Values())
  {
    Append(triples, std::uint8_t(1));
    Append(triples, static_cast<std::uint8_t>(value));
    Append(triples, std::uint8_t(2));
  }
  Save(folder + "colors.nrrd",
    "NRRD0003\ntype: unsigned char\ndimension: 4\nsizes: 3 5 4 3\nspacings: NaN 2 3 4\n"
    "kinds: RGB-color domain domain domain\nencoding: raw\n\n",
    triples);
  ReadOptions second;
  second.Component = 1;
  v = ReadVolume(folder + "colors.nrrd", second);
  CHECK_VOLUME(v, (Vec{ { 2. * Mark[0], 3. * Mark[1], 4. * Mark[2] } }), 100., "NRRD, colours");
  LT_CHECK(suite, !v.IsRAS);

  std::string ascii;
  for (const double value : Values())
  {
    ascii += std::to_string(value) + "\n";
  }
  Save(folder + "ascii.nrrd",
    "NRRD0004\ntype: float\ndimension: 3\nspace: RAS\n" + place + "encoding: ascii\n\n" + ascii);
  CHECK_VOLUME(ReadVolume(folder + "ascii.nrrd", {}), PermutedMark, 100., "NRRD, ascii");

  Save(folder + "short.nrrd",
    "NRRD0004\ntype: short\ndimension: 3\nspace: RAS\n" + place + "encoding: raw\n\n", Bytes(3, 0));
  CHECK_ERROR(folder + "short.nrrd", "truncated", "3 bytes");
  Save(folder + "bzip.nrrd",
    "NRRD0004\ntype: short\ndimension: 3\n" + place + "encoding: bzip2\n\n", Bytes(300, 0));
  CHECK_ERROR(folder + "bzip.nrrd", "bzip2", "gzip");
  Save(folder + "not.nrrd", "NRRRD\n");
  CHECK_ERROR(folder + "not.nrrd", "not a NRRD", "NRRD000");
}

void TestVti(Suite& suite, const std::string& folder)
{
  // An extent that does not start at 0, and a mirrored axis.
  vtkNew<vtkImageData> image;
  image->SetExtent(10, 10 + Dims[0] - 1, -4, -4 + Dims[1] - 1, 7, 7 + Dims[2] - 1);
  image->SetSpacing(2., 3., 4.);
  image->SetOrigin(1., 2., 3.);
  image->SetDirectionMatrix(-1, 0, 0, 0, 1, 0, 0, 0, 1);
  vtkNew<vtkFloatArray> array;
  array->SetName("density");
  for (const double v : Values())
  {
    array->InsertNextValue(static_cast<float>(v));
  }
  image->GetPointData()->SetScalars(array);
  vtkNew<vtkXMLImageDataWriter> writer;
  writer->SetInputData(image);
  writer->SetFileName((folder + "extent.vti").c_str());
  writer->Write();
  const Volume v = ReadVolume(folder + "extent.vti", {});
  CHECK_VOLUME(v,
    (Vec{ { 1. - 2 * (10 + Mark[0]), 2. + 3 * (-4 + Mark[1]), 3. + 4 * (7 + Mark[2]) } }), 100.,
    "VTI, extent and direction");
  LT_CHECK(suite, !v.IsRAS && v.FirstIndex[0] == 10);
  ReadOptions other;
  other.Array = "pressure";
  CheckError(suite, folder + "extent.vti", "pressure", "no array", __LINE__, other);

  Save(folder + "cut.vti", "<VTKFile type=\"ImageData\"><ImageData WholeExtent=\"0 1 0 1 0 1\">");
  CHECK_ERROR(folder + "cut.vti", "cannot read", "cut.vti");
  Save(folder + "text.vti", "nothing of the kind");
  CHECK_ERROR(folder + "text.vti", "text.vti", "not a VTK image");
}

#ifdef LIGHTVOLUME_SEGYIO
std::uint32_t Ibm(double value)
{
  // sign, exponent of 16 biased by 64, fraction of 24 bits.
  if (value == 0.)
  {
    return 0;
  }
  const std::uint32_t sign = value < 0. ? 0x80000000U : 0U;
  double fraction = std::abs(value);
  int exponent = 64;
  while (fraction >= 1.)
  {
    fraction /= 16.;
    ++exponent;
  }
  while (fraction < 1. / 16.)
  {
    fraction *= 16.;
    --exponent;
  }
  return sign | static_cast<std::uint32_t>(exponent) << 24U |
    static_cast<std::uint32_t>(fraction * 16777216.);
}

// Crosslines run fastest; x = 1000 + 25 * crossline index, y = 2000 + 50 * inline index, written
// times ten. Samples: Values() along inline, crossline, time.
Bytes Segy(int format, const std::vector<std::pair<int, int>>& without = {}, int dead = -1)
{
  Bytes b(3600, 0x40);
  std::fill(b.begin() + 3200, b.end(), 0);
  Put(b, 3216, std::int16_t(4000), true);
  Put(b, 3220, std::int16_t(Dims[2]), true);
  Put(b, 3224, static_cast<std::int16_t>(format), true);
  Put(b, 3254, std::int16_t(1), true);
  const std::vector<double> values = Values();
  int n = 0;
  for (int i = 0; i < Dims[0]; ++i)
  {
    for (int j = 0; j < Dims[1]; ++j)
    {
      if (std::find(without.begin(), without.end(), std::make_pair(i, j)) != without.end())
      {
        continue;
      }
      Bytes h(240, 0);
      Put(h, 188, static_cast<std::int32_t>(100 + 2 * i), true);
      Put(h, 192, static_cast<std::int32_t>(700 + j), true);
      Put(h, 28, static_cast<std::int16_t>(n == dead ? 2 : 1), true);
      Put(h, 70, std::int16_t(-10), true);
      Put(h, 180, static_cast<std::int32_t>(10 * (1000 + 25 * j)), true);
      Put(h, 184, static_cast<std::int32_t>(10 * (2000 + 50 * i)), true);
      Put(h, 108, std::int16_t(8), true);
      Put(h, 114, std::int16_t(Dims[2]), true);
      Put(h, 116, std::int16_t(4000), true);
      b.insert(b.end(), h.begin(), h.end());
      for (int k = 0; k < Dims[2]; ++k)
      {
        const double v = values[i + Dims[0] * (j + Dims[1] * k)];
        if (format == 1)
        {
          Append(b, Ibm(v), true);
        }
        else if (format == 3)
        {
          Append(b, static_cast<std::int16_t>(v), true);
        }
        else
        {
          Append(b, static_cast<float>(v), true);
        }
      }
      ++n;
    }
  }
  return b;
}

void TestSegy(Suite& suite, const std::string& folder)
{
  const Vec expected = { { 1000. + 25 * Mark[1], 2000. + 50 * Mark[0], -8. - 4 * Mark[2] } };
  for (const int format : { 1, 3, 5 })
  {
    const std::string path = folder + "format" + std::to_string(format) + ".sgy";
    Save(path, Segy(format));
    const Volume v = ReadVolume(path, {});
    CHECK_VOLUME(v, expected, 100., path.c_str());
    LT_CHECK(suite, v.Image->GetScalarType() == (format == 3 ? VTK_SHORT : VTK_FLOAT));
  }
  ReadOptions deep;
  deep.ZScale = 2.;
  Vec stretched = expected;
  stretched[2] *= 2.;
  CHECK_VOLUME(ReadVolume(folder + "format1.sgy", deep), stretched, 100., "SEG-Y, --z-scale");

  // A missing trace and a dead one are no data.
  Save(folder + "holes.sgy", Segy(3, { { 0, 0 } }, 4));
  const Volume holes = ReadVolume(folder + "holes.sgy", {});
  CHECK_VOLUME(holes, expected, 100., "SEG-Y, holes");
  int nan = 0;
  for (vtkIdType i = 0; i < holes.Image->GetNumberOfPoints(); ++i)
  {
    nan += std::isnan(holes.Image->GetPointData()->GetScalars()->GetComponent(i, 0)) ? 1 : 0;
  }
  LT_CHECK(suite, nan == 2 * Dims[2]);

  Bytes cut = Segy(5);
  cut.resize(cut.size() - 5);
  Save(folder + "cut.sgy", cut);
  CHECK_ERROR(folder + "cut.sgy", "truncated", "cut.sgy");
  Save(folder + "tiny.sgy", Bytes(100, 0));
  CHECK_ERROR(folder + "tiny.sgy", "truncated", "3600");
  Save(folder + "noise.sgy", Bytes(5000, 0x77));
  CHECK_ERROR(folder + "noise.sgy", "sample format", "IBM");
  // All traces at one line: not post-stack 3-D.
  Bytes same = Segy(3);
  for (std::size_t t = 3600; t < same.size(); t += 240 + 2 * Dims[2])
  {
    for (const int field : { 4, 8, 20, 188, 192 })
    {
      Put(same, t + field, std::int32_t(1), true);
    }
  }
  Save(folder + "prestack.sgy", same);
  CHECK_ERROR(folder + "prestack.sgy", "post-stack", "--inline-byte");
}
#endif

#ifdef LIGHTVOLUME_OPENVDB
void TestVdb(Suite& suite, const std::string& folder)
{
  vtkNew<vtkImageData> image;
  image->SetExtent(0, Dims[0] - 1, 2, 2 + Dims[1] - 1, -3, -3 + Dims[2] - 1);
  image->SetSpacing(2., 3., 4.);
  image->SetOrigin(1., 2., 3.);
  const double c = std::cos(vtkMath::RadiansFromDegrees(30.));
  image->SetDirectionMatrix(c, -.5, 0, .5, c, 0, 0, 0, 1);
  vtkNew<vtkFloatArray> array;
  array->SetName("Fluence");
  for (const double v : Values())
  {
    array->InsertNextValue(static_cast<float>(v + 1.)); // no zeros: the whole box is active
  }
  image->GetPointData()->SetScalars(array);
  WriteVdb(folder + "trip.vdb", image, { "Fluence" });
  const Volume v = ReadVolume(folder + "trip.vdb", {});
  const double i[3] = { double(Mark[0]), 2. + Mark[1], -3. + Mark[2] };
  Vec expected;
  image->TransformContinuousIndexToPhysicalPoint(i, expected.data());
  CHECK_VOLUME(v, expected, 101., "VDB round trip");
  LT_CHECK(suite, v.FirstIndex[1] == 2 && v.FirstIndex[2] == -3);
  bool same = true;
  for (vtkIdType n = 0; n < image->GetNumberOfPoints(); ++n)
  {
    same = same &&
      v.Image->GetPointData()->GetScalars()->GetComponent(n, 0) == array->GetComponent(n, 0);
  }
  LT_CHECK(suite, same);
  ReadOptions other;
  other.Array = "smoke";
  CheckError(suite, folder + "trip.vdb", "smoke", "'Fluence'", __LINE__, other);
  Save(folder + "text.vdb", "no VDB");
  CHECK_ERROR(folder + "text.vdb", "cannot read", "text.vdb");
  Bytes cut = ReadBytes(folder + "trip.vdb");
  cut.resize(150); // further on, OpenVDB itself leaks what it has read
  Save(folder + "cut.vdb", cut);
  CHECK_ERROR(folder + "cut.vdb", "cannot read", "cut.vdb");
}
#endif

#ifdef LIGHTVOLUME_DICOM
void WriteSeries(
  const std::string& folder, const std::string& prefix, int slices, const char* description)
{
  vtkNew<vtkImageData> image;
  image->SetDimensions(Dims[0], Dims[1], slices);
  image->SetSpacing(2., 3., 4.);
  image->AllocateScalars(VTK_SHORT, 1);
  const std::vector<double> values = Values();
  for (vtkIdType i = 0; i < image->GetNumberOfPoints(); ++i)
  {
    static_cast<short*>(image->GetScalarPointer())[i] =
      static_cast<short>(values[i % values.size()]);
  }
  // Axes to LPS, by rows: i along y, j along z, k along x.
  vtkNew<vtkMatrix4x4> patient;
  const double elements[16] = { 0, 0, 1, 10, 1, 0, 0, 20, 0, 1, 0, 30, 0, 0, 0, 1 };
  patient->DeepCopy(elements);
  vtkNew<vtkDICOMMetaData> meta;
  meta->Set(DC::SeriesDescription, description);
  meta->Set(DC::PatientName, "Test^Nobody");
  vtkNew<vtkDICOMCTGenerator> generator;
  vtkNew<vtkDICOMWriter> writer;
  writer->SetInputData(image);
  writer->SetMetaData(meta);
  writer->SetGenerator(generator);
  writer->SetPatientMatrix(patient);
  writer->SetRescaleSlope(2.);
  writer->SetRescaleIntercept(-1024.);
  writer->SetMemoryRowOrderToFileNative();
  writer->SetFilePrefix((folder + prefix).c_str());
  writer->SetFilePattern("%s-%04d.dcm");
  writer->Write();
}

void TestDicom(Suite& suite, const std::string& folder)
{
  const std::string mixed = folder + "dicom/";
  mkdir(mixed.c_str(), 0777);
  WriteSeries(mixed, "scout", 2, "scout");
  WriteSeries(mixed, "head", Dims[2], "head");
  Save(mixed + "README", "not DICOM\n");
  const Volume v = ReadVolume(mixed, {});
  const Vec expected = { { -PermutedMark[0], -PermutedMark[1], PermutedMark[2] } };
  CHECK_VOLUME(v, expected, 2. * 100. - 1024., "DICOM: largest series, rescaled, LPS to RAS");
  LT_CHECK(suite, v.IsRAS && v.Dimensions[2] == Dims[2]);
  LT_CHECK(suite,
    std::any_of(v.Notes.begin(), v.Notes.end(),
      [](const std::string& note)
      { return note.find("largest of 2 series") != std::string::npos; }));
  const std::string empty = folder + "dicom-empty/";
  mkdir(empty.c_str(), 0777);
  CHECK_ERROR(empty, "no DICOM images", "dicom-empty");
  Save(folder + "fake.dcm", "not DICOM at all, but long enough to look at, perhaps\n");
  CHECK_ERROR(folder + "fake.dcm", "cannot read", "fake.dcm");
}
#endif
} // namespace

int main(int argc, char* argv[])
{
  Suite suite(argc, argv);
  const std::string folder = suite.temporary + "/volume-reader/";
  mkdir(folder.c_str(), 0777);
  TestNifti(suite, folder);
  TestMetaImage(suite, folder);
  TestNrrd(suite, folder);
  TestVti(suite, folder);
#ifdef LIGHTVOLUME_SEGYIO
  TestSegy(suite, folder);
#endif
#ifdef LIGHTVOLUME_OPENVDB
  TestVdb(suite, folder);
#endif
#ifdef LIGHTVOLUME_DICOM
  TestDicom(suite, folder);
#endif
  return suite.result();
}
