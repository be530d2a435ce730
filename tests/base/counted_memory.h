// How often threads ask for memory, for tests of code that must not. For one source of a program, as it
// defines operator new. A thread counts once it has set `watched`, and while `counting`.
#pragma once

#include <atomic>
#include <cstdlib>
#include <new>
#include <utility>

namespace ferrobench::counted {

inline thread_local bool watched = false;
inline std::atomic<bool> counting = false;
inline std::atomic<int> asked = 0;
inline std::atomic<std::size_t> asked_first = 0;  // bytes

// What the thread asks for meanwhile is not counted.
class Pardon {
 public:
  Pardon() : before_(std::exchange(watched, false)) {}
  ~Pardon() { watched = before_; }
  Pardon(const Pardon&) = delete;
  Pardon& operator=(const Pardon&) = delete;

 private:
  bool before_;
};

inline void* take(std::size_t bytes, std::size_t alignment = 0) {
  if (watched && counting && asked++ == 0) asked_first = bytes;
  void* const out = alignment == 0
                        ? std::malloc(bytes == 0 ? 1 : bytes)
                        : std::aligned_alloc(alignment, (bytes + alignment - 1) / alignment * alignment);
  if (out == nullptr) throw std::bad_alloc();
  return out;
}

}  // namespace ferrobench::counted

void* operator new(std::size_t bytes) {
  return ferrobench::counted::take(bytes);
}
void* operator new(std::size_t bytes, std::align_val_t alignment) {
  return ferrobench::counted::take(bytes, static_cast<std::size_t>(alignment));
}
// A sanitizer has a nothrow form of its own, which free() below must not be given.
void* operator new(std::size_t bytes, const std::nothrow_t&) noexcept try {
  return ferrobench::counted::take(bytes);
} catch (const std::bad_alloc&) {
  return nullptr;
}
// Taken into a caller, free() looks to gcc as if it were given what another new has made.
[[gnu::noinline]] void operator delete(void* memory) noexcept {
  std::free(memory);
}
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept {
  std::free(memory);
}
[[gnu::noinline]] void operator delete(void* memory, std::align_val_t) noexcept {
  std::free(memory);
}
[[gnu::noinline]] void operator delete(void* memory, std::size_t, std::align_val_t) noexcept {
  std::free(memory);
}
