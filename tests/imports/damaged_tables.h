// Copies of testers' files that were damaged at random: bits turned, bytes overwritten or copied about,
// digits changed, lines left out, doubled or exchanged, the end cut off. Each must be refused by an error
// that says where, or come through with its samples as they were, or with a finding that the sound file has
// not.
#pragma once

#include <cstdint>
#include <filesystem>
#include <ostream>

#include "tests/imports/tester_files.h"

namespace ferrobench::imports {

struct DamageFigures {
  struct Row {
    std::string file{};
    int copies = 0, refused = 0;
    int same = 0;    // no sample differs: the damage is in what the header says of other things
    int stated = 0;  // samples differ, and a finding says that something is wrong
    int small = 0;   // samples differ by less than 2 % of their range
    int silent = 0;  // by more, and nothing says so
  };
  std::vector<Row> rows{};
  std::vector<std::string> failures{};  // not an Error, or one without a place
  std::vector<std::string> silent{};    // the files
  Row sum() const;
};
std::ostream& operator<<(std::ostream& out, const DamageFigures& figures);

// Of each file in turn; a copy that is in the way of a crash, or silent, is left in `folder`.
DamageFigures damage_tables(const std::vector<NamedFile>& files, int copies, std::uint64_t seed,
                            const std::filesystem::path& folder);

}  // namespace ferrobench::imports
