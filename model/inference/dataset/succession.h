// What the tables of one tester's file say of each other's past. They were measured on one specimen, one
// after the other, so each begins in the state that those before it left. Between two of them testers often
// cycle the specimen once through the program that comes next, and do not record it.
#pragma once

#include <span>
#include <vector>

#include "model/inference/dataset/recording_data.h"
#include "protocols/past.h"

namespace ferrobench::model {

// Of each recording, the pasts that the recordings before it leave open: with a cycle of its own program and
// without, from each state that has a name, as nothing is known of the specimen before the first of them.
// None where no recording is known to have come before. Recordings follow each other that an importer made of
// one file's tables, in the order of these.
//
// A past has the extreme levels of all recordings before. A loop that lies within a later one is left out, as
// the later one wipes out what it left (Mayergoyz, "Mathematical Models of Hysteresis and Their
// Applications", 2003, section 1.2), unless the later one was faster: switching takes time.
std::vector<std::vector<protocols::Past>> pasts_by_succession(std::span<const RecordingData> recordings);

}  // namespace ferrobench::model
