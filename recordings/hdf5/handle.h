// The HDF5 C API behind owning handles; the only header that includes <hdf5.h>.
#pragma once

#include <hdf5.h>

#include <utility>

namespace ferrobench::recordings::hdf5 {

// Owns one identifier of the library and closes it with the function that belongs to its kind.
// An identifier below zero (a failed call) is held as empty.
class Handle {
 public:
  using Close = herr_t (*)(hid_t);

  Handle() = default;
  Handle(hid_t id, Close closer) : id_(id), close_(closer) {}
  Handle(Handle&& other) noexcept : id_(std::exchange(other.id_, -1)), close_(other.close_) {}
  Handle& operator=(Handle&& other) noexcept {
    std::swap(id_, other.id_);
    std::swap(close_, other.close_);
    return *this;
  }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  ~Handle() { close(); }

  hid_t get() const { return id_; }
  explicit operator bool() const { return id_ >= 0; }
  // False if the library could not close it (for a file: what was still to be written is lost).
  bool close() { return id_ < 0 || close_(std::exchange(id_, -1)) >= 0; }

 private:
  hid_t id_ = -1;
  Close close_ = nullptr;
};

inline Handle file(hid_t id) {
  return {id, H5Fclose};
}
inline Handle group(hid_t id) {
  return {id, H5Gclose};
}
inline Handle dataset(hid_t id) {
  return {id, H5Dclose};
}
inline Handle space(hid_t id) {
  return {id, H5Sclose};
}
inline Handle type(hid_t id) {
  return {id, H5Tclose};
}
inline Handle attribute(hid_t id) {
  return {id, H5Aclose};
}
inline Handle properties(hid_t id) {
  return {id, H5Pclose};
}
inline Handle object(hid_t id) {
  return {id, H5Oclose};
}

// The library prints its errors unless told otherwise, thread by thread; it would load filters from whatever
// folder the environment names; and at the program's end it would go once more through files whose closing
// failed, and crash.
inline void prepare_thread() {
  thread_local const bool done = [] {
    H5dont_atexit();
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
    H5PLset_loading_state(0);
    return true;
  }();
  static_cast<void>(done);
}

// File access without locks: a recording can be read while it is being written.
inline Handle unlocked_access() {
  auto access = properties(H5Pcreate(H5P_FILE_ACCESS));
  H5Pset_file_locking(access.get(), false, true);
  H5Pset_fclose_degree(access.get(), H5F_CLOSE_STRONG);
  return access;
}

}  // namespace ferrobench::recordings::hdf5
