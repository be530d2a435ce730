// Texts of variable length in an HDF5 file, looked up here: the library trusts their lengths and chains,
// which in a damaged file lead out of its buffers or nowhere.
//
// Such a text lies in a global heap ("GCOL"). What a dataset or attribute holds is a reference of 16 bytes:
// length (4), address of the heap (8), index of the object in it (4), all little-endian.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

namespace ferrobench::recordings::hdf5 {

class MappedFile;

class Texts {
 public:
  explicit Texts(const std::string& path);
  ~Texts();
  Texts(const Texts&) = delete;
  Texts& operator=(const Texts&) = delete;

  // The text whose reference stands at `offset`; none if the reference leads nowhere.
  std::optional<std::string_view> at(std::uint64_t offset) const;
  // An attribute's own bytes are out of reach: every reference that follows its name in the file must be
  // good.
  bool sound_after(std::string_view name) const;

 private:
  using Objects = std::map<std::uint32_t, std::string_view>;  // of one heap, by index
  static std::optional<Objects> objects_of(std::string_view heap);

  std::unique_ptr<MappedFile> file_;
  std::map<std::uint64_t, Objects> heaps_;  // by address; one that does not hold together has no objects
};

}  // namespace ferrobench::recordings::hdf5
