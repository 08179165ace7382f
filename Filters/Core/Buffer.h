// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#ifndef LightTransport_Core_Buffer_h
#define LightTransport_Core_Buffer_h

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <memory>
#include <new>

namespace lighttransport
{
/**
 * Zeroed memory for one value per voxel, with a line of zeros on either side,
 * so that the kernels may read the neighbours of the first and last value.
 * Untouched pages cost nothing until they are written. Throws std::bad_alloc.
 */
template <class T>
class Buffer
{
public:
  Buffer() = default;
  explicit Buffer(std::int64_t size) { this->allocate(size); }

  void allocate(std::int64_t size)
  {
    this->release();
    if (size < 0 ||
      static_cast<std::uint64_t>(size) >
        (std::numeric_limits<std::size_t>::max() / sizeof(T)) - 2 * Pad)
    {
      throw std::bad_alloc();
    }
    this->memory.reset(
      static_cast<T*>(std::calloc(static_cast<std::size_t>(size) + 2 * Pad, sizeof(T))));
    if (!this->memory)
    {
      throw std::bad_alloc();
    }
    this->count = size;
  }
  void release()
  {
    this->memory.reset();
    this->count = 0;
  }

  T* data() { return this->memory ? this->memory.get() + Pad : nullptr; }
  const T* data() const { return this->memory ? this->memory.get() + Pad : nullptr; }
  T& operator[](std::int64_t i) { return this->data()[i]; }
  const T& operator[](std::int64_t i) const { return this->data()[i]; }
  std::int64_t size() const { return this->count; }
  bool empty() const { return this->count == 0; }
  std::int64_t bytes() const { return this->count * static_cast<std::int64_t>(sizeof(T)); }

private:
  static constexpr std::size_t Pad = 64 / sizeof(T);
  struct Free
  {
    void operator()(T* p) const { std::free(p); }
  };
  std::unique_ptr<T, Free> memory;
  std::int64_t count = 0;
};
} // namespace lighttransport

#endif
