#include "usbfs/testbed.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <filesystem>
#include <span>
#include <stdexcept>
#include <system_error>

#include "unit/descriptors.h"
#include "unit/requests.h"

namespace ferrobench::emulator {

namespace {

constexpr int bus = 1, usb_device_major = 189;
// One page: the smallest pipe, which one write fills and one read empties.
constexpr std::size_t pipe_capacity = 4096;

std::string three_digits(int number) {
  const std::string text = std::to_string(number);
  return std::string(3 - std::min<std::size_t>(3, text.size()), '0') + text;
}

std::string hex(std::span<const std::byte> bytes) {
  constexpr std::string_view digits = "0123456789ABCDEF";
  std::string out;
  for (const std::byte b : bytes) {
    out += digits[std::to_integer<unsigned>(b) >> 4];
    out += digits[std::to_integer<unsigned>(b) & 15U];
  }
  return out;
}

[[noreturn]] void fail(const std::string& what) {
  throw std::system_error(errno, std::generic_category(), what);
}

}  // namespace

Testbed::Testbed(IoctlHandler handler) : handler_(std::move(handler)), testbed_(nullptr) {
  testbed_ = umockdev_testbed_new();
  // Only now: the question is put to the testbed's own directory.
  if (umockdev_in_mock_environment()) return;
  g_object_unref(testbed_);
  throw std::runtime_error("no emulated bus here: start this program under umockdev-wrapper");
}

Testbed::~Testbed() {
  if (fifo_ >= 0) {
    g_autoptr(GError) error = nullptr;
    umockdev_testbed_detach_ioctl(testbed_, node_.c_str(), &error);
    close(fifo_);
  }
  g_object_unref(testbed_);
  if (ioctls_ != nullptr) g_object_unref(ioctls_);
}

void Testbed::plug(const UnitSetup& setup) {
  ++number_;
  const std::string name = "bus/usb/" + three_digits(bus) + "/" + three_digits(number_);
  node_ = "/dev/" + name;
  g_autofree gchar* root = umockdev_testbed_get_root_dir(testbed_);

  // The node is there before anybody hears of the device.
  const std::filesystem::path dev = std::filesystem::path(root) / "dev";
  std::filesystem::create_directories((dev / name).parent_path());
  if (mkfifo((dev / name).c_str(), 0600) != 0) fail("the device node");
  std::filesystem::create_directories(dev / ".node");
  std::string flat = name;
  for (char& c : flat)
    if (c == '/') c = '_';
  std::filesystem::create_symlink(std::to_string(usb_device_major) + ":" + std::to_string(number_ - 1),
                                  dev / ".node" / flat);
  fifo_ = open((dev / name).c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
  if (fifo_ < 0 || fcntl(fifo_, F_SETPIPE_SZ, pipe_capacity) < 0) fail("the device node's pipe");
  reapable_ = true;
  set_reapable(false);

  if (ioctls_ == nullptr) {
    ioctls_ = umockdev_ioctl_base_new();
    g_signal_connect(ioctls_, "handle-ioctl", G_CALLBACK(&Testbed::on_ioctl), this);
  }
  g_autoptr(GError) error = nullptr;
  if (!umockdev_testbed_attach_ioctl(testbed_, node_.c_str(), ioctls_, &error))
    throw std::runtime_error(std::string("the device node's calls: ") + error->message);

  auto descriptors = device_descriptor(setup);
  const auto configuration = configuration_descriptor(setup);
  descriptors.insert(descriptors.end(), configuration.begin(), configuration.end());
  std::array<char, 5> vendor{}, product{}, firmware{};
  std::snprintf(vendor.data(), vendor.size(), "%04x", vendor_id);
  std::snprintf(product.data(), product.size(), "%04x", setup.product);
  std::snprintf(firmware.data(), firmware.size(), "%04x", setup.firmware);
  const std::string port = std::to_string(bus) + "-1";
  syspath_ = "/sys/devices/pci0000:00/0000:00:14.0/usb" + std::to_string(bus) + "/" + port;
  const std::string entry =
      "P: " + syspath_.substr(4) + "\nE: DEVNAME=" + node_ +
      "\nE: DEVTYPE=usb_device\nE: SUBSYSTEM=usb\nE: MAJOR=" + std::to_string(usb_device_major) +
      "\nE: MINOR=" + std::to_string(number_ - 1) + "\nE: BUSNUM=" + three_digits(bus) +
      "\nE: DEVNUM=" + three_digits(number_) + "\nE: ID_VENDOR_ID=" + vendor.data() +
      "\nE: ID_MODEL_ID=" + product.data() + "\nA: busnum=" + std::to_string(bus) +
      "\\n\nA: devnum=" + std::to_string(number_) +
      "\\n\nA: speed=" + (setup.speed == Speed::high ? "480" : "12") + "\\n\nA: idVendor=" + vendor.data() +
      "\\n\nA: idProduct=" + product.data() + "\\n\nA: bcdDevice=" + firmware.data() +
      "\\n\nA: serial=" + setup.serial +
      "\\n\nA: bConfigurationValue=1\\n\nA: bNumConfigurations=1\\n\nH: descriptors=" + hex(descriptors) +
      "\n";
  if (!umockdev_testbed_add_from_string(testbed_, entry.c_str(), &error))
    throw std::runtime_error(std::string("the device's sysfs entries: ") + error->message);
}

void Testbed::unplug() {
  if (fifo_ < 0) return;
  umockdev_testbed_uevent(testbed_, syspath_.c_str(), "remove");
  umockdev_testbed_remove_device(testbed_, syspath_.c_str());
  g_autoptr(GError) error = nullptr;
  umockdev_testbed_detach_ioctl(testbed_, node_.c_str(), &error);
  // Whoever has the node open still has it, and may reap.
  set_reapable(true);
  close(fifo_);
  fifo_ = -1;
  g_autofree gchar* root = umockdev_testbed_get_root_dir(testbed_);
  std::filesystem::remove(std::filesystem::path(root) / node_.substr(1));
}

void Testbed::set_reapable(bool reapable) {
  if (fifo_ < 0 || reapable == reapable_) return;
  reapable_ = reapable;
  std::array<char, pipe_capacity> page{};
  // A pipe has room, so is ready for writing, as long as it is empty.
  const auto done = reapable ? read(fifo_, page.data(), page.size()) : write(fifo_, page.data(), page.size());
  if (done < 0 && errno != EAGAIN) fail("the device node's pipe");
}

gboolean Testbed::on_ioctl(UMockdevIoctlBase*, UMockdevIoctlClient* client, gpointer self) {
  auto& testbed = *static_cast<Testbed*>(self);
  constexpr const char* key = "ferrobench-client";  // its address may have been another one's before
  if (g_object_get_data(G_OBJECT(client), key) == nullptr)
    g_object_set_data(G_OBJECT(client), key, reinterpret_cast<gpointer>(++testbed.clients_));  // NOLINT
  const auto number = reinterpret_cast<std::uintptr_t>(g_object_get_data(G_OBJECT(client), key));
  UMockdevIoctlData* arg = umockdev_ioctl_client_get_arg(client);
  const int result = testbed.handler_(umockdev_ioctl_client_get_devnode(client), number,
                                      umockdev_ioctl_client_get_request(client), *arg);
  if (result >= 0)
    umockdev_ioctl_client_complete(client, result, 0);
  else
    umockdev_ioctl_client_complete(client, -1, -result);
  return TRUE;
}

}  // namespace ferrobench::emulator
