// The units attached to this machine.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/fields.h"
#include "daq/usb/link.h"

namespace ferrobench::daq::usb {

struct UnitFound {
  std::string name{};           // of the product
  std::string serial_number{};  // "" if it cannot be read
  std::string path{};           // where it is plugged in: bus and ports
  bool drives = false;          // whether this program can play a waveform on it
  bool permitted = false;       // whether this user may open it
  std::string problem{};        // what is in the way and what to do, "" if nothing
};
template <class Visitor>
void describe(Visitor& visit, UnitFound& u) {
  visit("name", u.name, {.doc = "of the product"});
  visit("serial_number", u.serial_number, {.doc = "\"\" if it cannot be read"});
  visit("path", u.path, {.doc = "where it is plugged in: bus and ports"});
  visit("drives", u.drives, {.doc = "whether this program can play a waveform on it"});
  visit("permitted", u.permitted, {.doc = "whether this user may open it"});
  visit("problem", u.problem, {.doc = "what is in the way and what to do, \"\" if nothing"});
}

// Those of the vendor's products that are known here, as they are plugged in now.
std::vector<UnitFound> units();

// Opens the unit with this serial number, or the only one attached if it is "". Throws
// Error(device_unavailable) that says what is missing and what to do.
std::unique_ptr<Link> open_unit(const std::string& serial_number);

}  // namespace ferrobench::daq::usb
