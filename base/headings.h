// What a column's heading says of its unit. Units are never guessed: what has the look of one and is none of
// these is handed on as it is written, for whoever reads the table to refuse.
//
//     field_kV_per_mm   E [kV/mm]   E (kV/mm)   U/V   t / ms   E/(kV/mm)   voltage V   field_kV/mm   kV
//     E [kV mm^-1]   time in s
#pragma once

#include <array>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace ferrobench {

enum class Quantity {
  time,
  field,
  voltage,
  charge,
  displacement,
  force,
  current,
  current_density,
  polarization,
  area
};
inline constexpr std::array<Quantity, 10> all_quantities{
    Quantity::time,         Quantity::field, Quantity::voltage, Quantity::charge,
    Quantity::displacement, Quantity::force, Quantity::current, Quantity::current_density,
    Quantity::polarization, Quantity::area};
// What a heading may say that nobody asked for one of. The rest must be asked for: "loop A" is no current.
inline constexpr std::array<Quantity, 6> every_quantity{Quantity::time,         Quantity::field,
                                                        Quantity::voltage,      Quantity::charge,
                                                        Quantity::displacement, Quantity::force};

struct KnownUnit {
  std::string_view text;
  Quantity quantity;
  double si;  // SI units in one of it
};

// nullptr if there is none of these quantities; case counts. "kV_per_mm" and "kV mm^-1" are "kV/mm", and "um"
// may be written with a Greek letter.
const KnownUnit* find_unit(std::string_view text, std::span<const Quantity> quantities = every_quantity);
std::vector<std::string> units_of(std::span<const Quantity> quantities);

struct Heading {
  std::string name, unit;  // as written; unit "" if it says none
};
// A unit without brackets is one of these quantities, or has a slash: no word does.
Heading read_heading(std::string_view text, std::span<const Quantity> quantities = every_quantity);
// "voltage", "U", "V1": to take this for a field would be a guess.
bool names_a_voltage(std::string_view name);

}  // namespace ferrobench
