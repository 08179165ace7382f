// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#ifndef LightTransport_Core_Buffer_h
#define LightTransport_Core_Buffer_h

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <memory>
#include <new>

#if defined(__linux__)
#include <sys/mman.h>
#endif

namespace lighttransport
{
/** Small: where only a part of the memory will be touched. */
enum class Pages
{
  Small,
  Large
};

/**
 * Asks for large pages where the system has them: the first touch then costs a tenth, and what is
 * touched is rounded up to 2 MiB.
 */
inline void PreferLargePages(void* memory, std::size_t bytes)
{
#if defined(MADV_HUGEPAGE)
  constexpr std::uintptr_t page = std::uintptr_t(1) << 21;
  const std::uintptr_t begin = reinterpret_cast<std::uintptr_t>(memory);
  const std::uintptr_t from = (begin + page - 1) / page * page;
  const std::uintptr_t to = (begin + bytes) / page * page;
  if (from < to)
  {
    madvise(reinterpret_cast<void*>(from), to - from, MADV_HUGEPAGE); // a wish
  }
#else
  (void)memory;
  (void)bytes;
#endif
}

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
  explicit Buffer(std::int64_t size, Pages pages = Pages::Large) { this->allocate(size, pages); }

  void allocate(std::int64_t size, Pages pages = Pages::Large)
  {
    this->release();
    if (size < 0 ||
      static_cast<std::uint64_t>(size) >
        (std::numeric_limits<std::size_t>::max() / sizeof(T)) - (std::size_t(1) << 17))
    {
      throw std::bad_alloc();
    }
    // Aligned to a line of the cache, as the pads are; and large ones staggered, since kernels
    // read many at the same index and the caches' sets repeat every few kilobytes.
    const std::size_t bytes = (static_cast<std::size_t>(size) + 2 * Pad) * sizeof(T);
    static std::atomic<unsigned> number{ 0 };
    const std::size_t shift = bytes < (std::size_t(1) << 20) ? 0 : number++ % 16 * (65 * Line);
    this->memory.reset(static_cast<char*>(std::calloc(bytes + Line + shift, 1)));
    if (!this->memory)
    {
      throw std::bad_alloc();
    }
    if (pages == Pages::Large && bytes >= (std::size_t(1) << 22))
    {
      PreferLargePages(this->memory.get(), bytes);
    }
    const std::uintptr_t start = reinterpret_cast<std::uintptr_t>(this->memory.get());
    this->first = reinterpret_cast<T*>((start + Line - 1) / Line * Line + shift) + Pad;
    this->count = size;
  }
  void release()
  {
    this->memory.reset();
    this->first = nullptr;
    this->count = 0;
  }

  T* data() { return this->first; }
  const T* data() const { return this->first; }
  T& operator[](std::int64_t i) { return this->data()[i]; }
  const T& operator[](std::int64_t i) const { return this->data()[i]; }
  std::int64_t size() const { return this->count; }
  bool empty() const { return this->count == 0; }
  std::int64_t bytes() const { return this->count * static_cast<std::int64_t>(sizeof(T)); }

private:
  static constexpr std::size_t Line = 64;
  static constexpr std::size_t Pad = Line / sizeof(T);
  struct Free
  {
    void operator()(char* p) const { std::free(p); }
  };
  std::unique_ptr<char, Free> memory;
  T* first = nullptr;
  std::int64_t count = 0;
};
} // namespace lighttransport

#endif
