// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * JSON, just enough to write a report: ordered objects, arrays, numbers, strings.
 * NaN and infinity, which JSON does not have, become null.
 */
#ifndef LightVolume_Report_h
#define LightVolume_Report_h

#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace lightvolume
{
class Json
{
public:
  Json() = default; // null
  Json(double value);
  Json(int value);
  Json(bool value);
  Json(const char* value);
  Json(const std::string& value);
  template <typename T>
  static Json List(const T& values)
  {
    Json list;
    list.Of = Array;
    for (const auto& value : values)
    {
      list.Items.emplace_back("", Json(value));
    }
    return list;
  }

  /** A member of an object, made where it is missing. */
  Json& operator[](const std::string& key);
  void Append(const Json& value);

  std::string Write(int indent = 0) const;

private:
  enum Kind
  {
    Null,
    Scalar,
    Object,
    Array
  } Of = Null;
  std::string Text; // of a scalar, as it is written
  std::vector<std::pair<std::string, Json>> Items;
};

/** The folder exists afterwards and a file can be made in it: else an Error. */
void PrepareFolder(const std::string& folder);

/**
 * Write a file under another name and rename it when it is whole, so that no
 * half-written one is ever seen under its own. `write` gets the other name, which
 * has the same extension.
 */
void WriteWhole(const std::string& path, const std::function<void(const std::string&)>& write);

} // namespace lightvolume

#endif
