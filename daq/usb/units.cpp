#include "daq/usb/units.h"

#include <algorithm>
#include <array>
#include <fstream>

#include "daq/usb/libusb_link.h"
#include "daq/usb/models.h"

namespace ferrobench::daq::usb {

namespace {

constexpr const char* permission_hint =
    "copy daq/usb/60-ferrobench.rules of the source to /etc/udev/rules.d, run 'udevadm control --reload' and "
    "plug "
    "the unit in again";

// One unit on the bus, opened if this user may.
struct Attached {
  DeviceId id;
  const ProductModel* model = nullptr;
  libusb_device_handle* handle = nullptr;
  int error = 0;  // of opening
};

std::string path_of(libusb_device* device) {
  std::array<std::uint8_t, 8> ports{};
  const int depth = libusb_get_port_numbers(device, ports.data(), static_cast<int>(ports.size()));
  std::string out = std::to_string(libusb_get_bus_number(device));
  for (int i = 0; i < depth; ++i)
    out += (i == 0 ? "-" : ".") + std::to_string(ports.at(static_cast<std::size_t>(i)));
  return out;
}

// The kernel tells the serial number even to those who may not open the unit.
std::string serial_from_kernel(const std::string& path) {
  std::ifstream file("/sys/bus/usb/devices/" + path + "/serial");
  std::string serial;
  std::getline(file, serial);
  return excerpt(serial);
}

std::string serial_of(libusb_device_handle* handle, const libusb_device_descriptor& descriptor) {
  std::array<unsigned char, 256> text{};
  const int size = libusb_get_string_descriptor_ascii(handle, descriptor.iSerialNumber, text.data(),
                                                      static_cast<int>(text.size()));
  return size <= 0 ? ""
                   : excerpt({reinterpret_cast<const char*>(text.data()), static_cast<std::size_t>(size)});
}

// Every known product that is attached; the caller owns the handles.
std::vector<Attached> attached(const UsbContext& context) {
  std::vector<Attached> out;
  libusb_device** list = nullptr;
  const auto count = libusb_get_device_list(context.context, &list);
  for (ssize_t i = 0; i < count; ++i) {
    libusb_device_descriptor descriptor{};
    if (libusb_get_device_descriptor(list[i], &descriptor) != LIBUSB_SUCCESS) continue;
    const auto* model = find_model(descriptor.idVendor, descriptor.idProduct);
    if (model == nullptr) continue;
    Attached a{.id = {.vendor = descriptor.idVendor,
                      .product = descriptor.idProduct,
                      .firmware = descriptor.bcdDevice,
                      .path = path_of(list[i])},
               .model = model};
    a.error = libusb_open(list[i], &a.handle);
    if (a.error == LIBUSB_SUCCESS) a.id.serial = serial_of(a.handle, descriptor);
    if (a.id.serial.empty()) a.id.serial = serial_from_kernel(a.id.path);
    out.push_back(std::move(a));
  }
  if (count >= 0) libusb_free_device_list(list, 1);
  return out;
}

void close(std::vector<Attached>& units) {
  for (auto& unit : units)
    if (unit.handle != nullptr) libusb_close(std::exchange(unit.handle, nullptr));
}

std::string problem_of(const Attached& unit) {
  if (unit.error == LIBUSB_ERROR_ACCESS) return std::string("no permission: ") + permission_hint;
  if (unit.error != LIBUSB_SUCCESS) return std::string("cannot be opened: ") + libusb_strerror(unit.error);
  if (!unit.model->driven) return "this driver does not speak to it yet";
  if (unit.model->outputs == 0) return "has no analog output, so it cannot drive a specimen";
  return "";
}

Error unavailable(std::string message, nlohmann::json given, nlohmann::json allowed, std::string hint) {
  return {ErrorCode::device_unavailable, std::move(message),
          Problem{.path = "/serial_number",
                  .given = std::move(given),
                  .allowed = std::move(allowed),
                  .hint = std::move(hint)}};
}

// The one that is meant, or an error that says why there is none.
Attached& choose(std::vector<Attached>& units, const std::string& serial) {
  auto serials = nlohmann::json::array();
  for (const auto& unit : units) serials.push_back(unit.id.serial);
  if (units.empty())
    throw unavailable(
        "no USB-1608GX-2AO is attached", nullptr, nullptr,
        "plug the unit in and check its cable; ferrobench call device.list shows what is attached");
  if (serial.empty()) {
    const auto drives = [](const Attached& u) { return u.model->driven && u.model->outputs > 0; };
    const auto count = std::ranges::count_if(units, drives);
    if (count > 1)
      throw unavailable("more than one unit is attached", "", serials, "name the one meant as serial_number");
    const auto found = std::ranges::find_if(units, drives);
    return found == units.end() ? units.front() : *found;
  }
  const auto found = std::ranges::find_if(units, [&](const auto& u) { return u.id.serial == serial; });
  if (found == units.end())
    throw unavailable("no unit with this serial number is attached", excerpt(serial), serials,
                      "plug it in, or correct serial_number");
  return *found;
}

}  // namespace

std::vector<UnitFound> units() {
  const UsbContext context;
  auto found = attached(context);
  std::vector<UnitFound> out;
  out.reserve(found.size());
  for (const auto& unit : found)
    out.push_back({.name = std::string(unit.model->name),
                   .serial_number = unit.id.serial,
                   .path = unit.id.path,
                   .drives = unit.model->driven && unit.model->outputs > 0,
                   .permitted = unit.error == LIBUSB_SUCCESS,
                   .problem = problem_of(unit)});
  close(found);
  return out;
}

std::unique_ptr<Link> open_unit(const std::string& serial) {
  auto context = std::make_shared<UsbContext>();
  auto found = attached(*context);
  try {
    auto& unit = choose(found, serial);
    if (unit.error == LIBUSB_ERROR_ACCESS)
      throw unavailable("no permission to use USB unit " + unit.id.serial + " at " + unit.id.path,
                        unit.id.serial, nullptr, permission_hint);
    if (unit.error != LIBUSB_SUCCESS)
      throw unavailable("USB unit " + unit.id.serial + " at " + unit.id.path +
                            " cannot be opened: " + libusb_strerror(unit.error),
                        unit.id.serial, nullptr, "unplug it and plug it in again");
    auto link = std::make_unique<LibusbLink>(context, std::exchange(unit.handle, nullptr), unit.id);
    close(found);
    return link;
  } catch (...) {
    close(found);
    throw;
  }
}

}  // namespace ferrobench::daq::usb
