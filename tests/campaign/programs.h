// The eight field programs of a bench: slow and fast loops, unipolar, holds at two prestresses, minor loops,
// fast steps, rest. Corners lie on samples.
#pragma once

#include <random>
#include <string>
#include <vector>

#include "protocols/past.h"

namespace ferrobench::campaign {

struct FieldProgram {
  std::string name;
  std::vector<double> time, command;  // s, V/m
  double prestress = 1, spring = 1;   // factors on the bench's load
  protocols::Past past{};             // of the specimen; unknown: poled towards +
};

// `top` [V/m] saturates the bench's material. Together about 30,000 samples.
std::vector<FieldProgram> draw_programs(std::mt19937_64& random, double top);

}  // namespace ferrobench::campaign
