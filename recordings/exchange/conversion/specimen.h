// The specimen of an import: what the user says, else what the source's header says, else an error that says
// what to give. Never a guess.
#pragma once

#include <optional>
#include <string>

#include "base/error.h"
#include "recordings/exchange/conversion/measured.h"
#include "recordings/exchange/testers/tester_table.h"

namespace ferrobench::recordings {

struct KnownSpecimen {
  std::string name{};
  std::optional<double> length{}, area{}, layer_thickness{};  // m, m^2, m
  std::optional<std::int64_t> layer_count{};
};

// Area, thickness, layers and name as testers write them; what is not understood is Error(bad_recording),
// unless it is given.
KnownSpecimen specimen_in_header(const TesterTable& table, const KnownSpecimen& given);

// Error(invalid_params) with a problem for each of them that nobody says. The length is that of all layers
// where nobody says another one, unless `demand_length`. What was taken from where goes into `findings`.
Specimen settle_specimen(const KnownSpecimen& given, const KnownSpecimen& stated, bool demand_length,
                         Findings& findings);
// The same, for who has more to complain of: with ones in place of what is missing.
Specimen settle_specimen(const KnownSpecimen& given, const KnownSpecimen& stated, bool demand_length,
                         Findings& findings, std::vector<Problem>& problems);

}  // namespace ferrobench::recordings
