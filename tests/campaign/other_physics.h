// Base physics that is not the model's: what a real specimen does otherwise than the equations that are
// fitted to it, in every recording. Parts that are neutral in the model, so that each can be played beside
// any effect.
#pragma once

#include "tests/campaign/outsiders.h"

namespace ferrobench::campaign {

std::span<const Outsider> other_physics();

// Why this effect of the catalogue cannot be told from, or solved together with, this physics; empty if it
// can.
std::string_view collision(std::string_view physics, std::string_view effect);

}  // namespace ferrobench::campaign
