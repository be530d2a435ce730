// What the tables of one tester's file say of each other's past. They were measured on one specimen, one
// after the other, so each begins in the state that those before it left. Before each of them testers often
// cycle the specimen once through the program that comes next, and do not record it.
#pragma once

#include <span>
#include <vector>

#include "model/inference/dataset/recording_data.h"
#include "protocols/past.h"

namespace ferrobench::model {

// The tables of one file.
struct Succession {
  std::vector<std::size_t> recordings;  // in the order in which they were measured
  // What is left open: whether each table was cycled before, and from which state that has a name the first
  // of them began. The pasts of all tables under each of these hypotheses.
  std::vector<std::vector<protocols::Past>> hypotheses;
};

// Recordings follow each other that an importer made of one file's tables, in the order of these.
//
// A past is the way through the programs of all tables before. One is left out where a later one wipes out
// what it left (Mayergoyz, "Mathematical Models of Hysteresis and Their Applications", 2003, section 1.2).
// Since switching takes time and cycles that are alike go on to change the specimen, it does that if it goes
// well beyond the earlier one on both sides and is not much faster, or if many such programs go as far.
std::vector<Succession> successions(std::span<const RecordingData> recordings);

}  // namespace ferrobench::model
