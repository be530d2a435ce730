// Units as people read them: "um kV/mm" -> "µm kV/mm", "C/m^2" -> "C/m²", "Ohm m" -> "Ω m". Keys and headings
// of files keep the letters of ASCII.
#pragma once

#include <string>
#include <string_view>

namespace ferrobench {

std::string shown_unit(std::string_view unit);  // UTF-8

}  // namespace ferrobench
