// Base physics that is not the model's: what a real specimen does otherwise, in every recording, than the
// equations that are fitted to it. The twin plays it like effects, beside any of them.
#pragma once

#include "tests/campaign/outsiders.h"

namespace ferrobench::campaign {

std::span<const Outsider> other_physics();

// Why this effect of the catalogue cannot be told from, or solved together with, this physics; empty if it
// can.
std::string_view collision(std::string_view physics, std::string_view effect);

}  // namespace ferrobench::campaign
