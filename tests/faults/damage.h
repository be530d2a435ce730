// Recordings, journals and CSV tables that were damaged at random: bits turned, bytes overwritten or copied
// about, the end cut off. Each goes through the reader, the report, recovery or the importer, and what could
// be read is replayed. Each must be refused by an error or come through whole: no crash, no other exception,
// no sample invented, the output at zero.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <ostream>
#include <string>
#include <vector>

namespace ferrobench::faults {

// plain: without checksums on its structure; forged: with wrong structure and right checksums for it
enum class DamagedKind { recording, plain_recording, journal, csv, forged_recording };

struct DamageFigures {
  struct Row {
    int files = 0, refused = 0, read = 0, replayed = 0;
  };
  std::array<Row, 5> rows{};  // by DamagedKind
  std::vector<std::string> failures;
};
std::ostream& operator<<(std::ostream& out, const DamageFigures& figures);

// The bytes of a sound file of each kind but the last; `folder` is for making them.
std::array<std::string, 4> sound_files(const std::filesystem::path& folder);

// The bytes of `files` recordings with wrong structure and right checksums for it.
std::vector<std::string> forged_files(int files, std::uint64_t seed, const std::filesystem::path& folder);

// A recording at `path` whose datasets of samples have `rows` rows of zeros each, which take a thousandth of
// that in the file. `folder` is for making it.
void write_zeros(std::uint64_t rows, const std::string& path, const std::filesystem::path& folder);

// `files` files of every kind in turn, one after the other in `folder`, so that the one that a crash is due
// to is left there.
DamageFigures damage_files(int files, std::uint64_t seed, const std::filesystem::path& folder);

}  // namespace ferrobench::faults
