// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * Loops that can be cancelled: a solver keeps a WatchedFor in place of a ParallelFor, and each of
 * its calls says with an Asking whom to ask. Its loops then run in pieces and end by an
 * Interrupted, thrown in the calling thread, once the answer is no. What must not be left half done
 * (a field that is changed in place) runs by whole().
 */
#ifndef LightTransport_Core_Watched_h
#define LightTransport_Core_Watched_h

#include "Core/Parallel.h"

#include <algorithm>
#include <chrono>
#include <memory>
#include <utility>

namespace lighttransport
{
/** Seconds, of a clock that only goes forward. */
inline double now()
{
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/** What a watched loop throws where its caller is told to stop. */
struct Interrupted
{
};

class WatchedFor
{
  struct State
  {
    ParallelFor plain;
    ProgressFunction ask;
    double fraction = 0.;
    double asked = 0.;

    void poll()
    {
      constexpr double interval = 0.01; // seconds
      if (this->ask && now() - this->asked > interval)
      {
        const bool goOn = this->ask(this->fraction);
        this->asked = now();
        if (!goOn)
        {
          throw Interrupted();
        }
      }
    }
    /**
     * In pieces, which grow until one takes some milliseconds: what a range costs is not known, and
     * in fresh memory it may be a hundred times what it is in the next.
     */
    void run(std::int64_t n, const RangeBody& body)
    {
      if (!this->ask)
      {
        this->plain(n, body);
        return;
      }
      const std::int64_t most = n / 32;
      std::int64_t piece = n / 256;
      for (std::int64_t begin = 0; begin < n;)
      {
        piece = std::max<std::int64_t>(8, piece); // for all threads
        const double began = now();
        const std::int64_t length = std::min(piece, n - begin);
        this->plain(
          length, [&](std::int64_t from, std::int64_t to) { body(begin + from, begin + to); });
        begin += length;
        const double took = now() - began;
        piece = took < 2e-3 ? 4 * piece : took > 8e-3 ? piece / 2 : piece;
        // of what took next to nothing, four times as much may even be in fresh memory
        piece = took < 2e-4 ? piece : std::min(most, piece);
        this->poll();
      }
    }
  };

public:
  explicit WatchedFor(ParallelFor plain)
    : state(std::make_shared<State>())
  {
    this->state->plain = std::move(plain);
    this->loop = [to = this->state](std::int64_t n, const RangeBody& body) { to->run(n, body); };
  }

  operator const ParallelFor&() const { return this->loop; }
  void operator()(std::int64_t n, const RangeBody& body) const { this->loop(n, body); }
  /** The same loop, from end to end. */
  const ParallelFor& whole() const { return this->state->plain; }
  /** For a serial loop, now and then: asks where nobody was asked for some time. */
  void poll() const { this->state->poll(); }
  /** The fraction done, in [0, 1], that is told when asking. */
  void tell(double fraction) const { this->state->fraction = fraction; }

  /** While it lives, `ask` is asked every 10 ms; nobody, where it is empty. */
  class Asking
  {
  public:
    Asking(const WatchedFor& loop, const ProgressFunction& ask)
      : state(loop.state)
      , before(std::move(state->ask))
    {
      this->state->ask = ask;
    }
    ~Asking() { this->state->ask = std::move(this->before); }
    Asking(const Asking&) = delete;
    Asking& operator=(const Asking&) = delete;

  private:
    std::shared_ptr<State> state;
    ProgressFunction before;
  };

private:
  std::shared_ptr<State> state;
  ParallelFor loop;
};

/**
 * Writes to each page of memory what stands there: the system hands it out now, in pieces that can
 * be interrupted, and not in a pass that cannot. Fresh memory may take a second for a gigabyte.
 * In one access that reads and writes: a page that is read first is lent, and costs ten times as
 * much when it is written to.
 */
template <class T>
void Touch(T* values, std::int64_t n, const WatchedFor& loop)
{
  constexpr std::int64_t page = 4096 / static_cast<std::int64_t>(sizeof(T));
  const ParallelFor& watched = loop;
  watched((n + page - 1) / page,
    [values](std::int64_t begin, std::int64_t end)
    {
      for (std::int64_t i = begin; i < end; ++i)
      {
#if defined(__GNUC__) || defined(__clang__)
        __atomic_fetch_or(reinterpret_cast<unsigned char*>(values + i * page), 0, __ATOMIC_RELAXED);
#else
        volatile T& value = values[i * page];
        const T same = value;
        value = same;
#endif
      }
    });
}
} // namespace lighttransport

#endif
