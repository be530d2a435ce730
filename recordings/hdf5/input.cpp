#include "recordings/hdf5/input.h"

#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>

#include "base/error.h"

namespace ferrobench::recordings::hdf5 {
namespace {

constexpr double most_bytes = 32e9;       // of one dataset
constexpr double most_text_bytes = 32e6;  // of one text, or of all the texts of a list
constexpr double most_chunk_bytes = 256e6;
constexpr double deflate_ratio = 1032;  // the most that deflate can expand
constexpr std::uint64_t block_rows = 1u << 20;

// Bytes that are not UTF-8 become U+FFFD, so that any text read can go into JSON and HTML.
std::string utf8(std::string_view text) {
  const auto dumped = nlohmann::json(text).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  return nlohmann::json::parse(dumped).get<std::string>();
}

double elements(const Handle& space) {
  const auto count = H5Sget_simple_extent_npoints(space.get());
  return count < 0 ? std::numeric_limits<double>::infinity() : static_cast<double>(count);
}

bool is_number(const Handle& type) {
  const auto kind = H5Tget_class(type.get());
  return kind == H5T_INTEGER || kind == H5T_FLOAT;
}

// Rows of a chunk; 0 if there are no chunks.
std::uint64_t chunk_rows(const Handle& set) {
  const auto how = properties(H5Dget_create_plist(set.get()));
  std::array<hsize_t, H5S_MAX_RANK> chunk{};
  const bool chunked = H5Pget_layout(how.get()) == H5D_CHUNKED;
  return chunked && H5Pget_chunk(how.get(), H5S_MAX_RANK, chunk.data()) > 0 ? chunk[0] : 0;
}

}  // namespace

Input::Input(const std::string& path) : path_(path) {
  prepare_thread();
  std::error_code ignored;
  if (!std::filesystem::exists(path, ignored))
    throw Error(ErrorCode::not_found, "there is no recording of this name",
                Problem{.message = "no such file", .given = path});
  if (!std::filesystem::is_regular_file(path, ignored)) fail("", "is not a file");
  const auto access = unlocked_access();
  file_ = file(H5Fopen(path.c_str(), H5F_ACC_RDONLY, access.get()));
  if (!file_) fail("", "is not a readable HDF5 file", "it may be cut short or damaged, or of another kind");
}

void Input::fail(const std::string& place, const std::string& message, const std::string& hint) const {
  throw Error(ErrorCode::bad_recording, "the file is not a readable recording",
              Problem{.path = place, .message = message, .given = path_, .hint = hint});
}

bool Input::has(const std::string& place) const {
  for (std::size_t end = place.find('/', 1);; end = place.find('/', end + 1)) {
    const auto part = place.substr(0, end);
    const auto there = H5Lexists(file_.get(), part.c_str(), H5P_DEFAULT);
    if (there < 0) fail(part, "could not be read");
    if (there == 0) return false;
    H5L_info_t info;
    if (H5Lget_info(file_.get(), part.c_str(), &info, H5P_DEFAULT) < 0) fail(part, "could not be read");
    if (info.type != H5L_TYPE_HARD)
      fail(part, "is a link to somewhere else", "put the data itself into the file");
    if (end == std::string::npos) return true;
    const auto node = object(H5Oopen(file_.get(), part.c_str(), H5P_DEFAULT));
    if (!node || H5Iget_type(node.get()) != H5I_GROUP) fail(part, "is not a group");
  }
}

Handle Input::open(const std::string& place) const {
  if (!has(place)) fail(place, "is missing");
  auto node = object(H5Oopen(file_.get(), place.c_str(), H5P_DEFAULT));
  if (!node) fail(place, "could not be read");
  if (H5Iget_type(node.get()) != H5I_DATASET) fail(place, "is not a dataset");
  const auto how = properties(H5Dget_create_plist(node.get()));
  if (!how) fail(place, "could not be read");
  const auto layout = H5Pget_layout(how.get());
  if (layout != H5D_COMPACT && layout != H5D_CONTIGUOUS && layout != H5D_CHUNKED)
    fail(place, "does not hold its data itself");
  if (layout == H5D_CONTIGUOUS && H5Pget_external_count(how.get()) != 0)
    fail(place, "keeps its data in another file");
  if (layout == H5D_CHUNKED) {
    std::array<hsize_t, H5S_MAX_RANK> chunk{};
    const int rank = H5Pget_chunk(how.get(), H5S_MAX_RANK, chunk.data());
    double bytes = static_cast<double>(H5Tget_size(type(H5Dget_type(node.get())).get()));
    for (int i = 0; i < rank; ++i) bytes *= static_cast<double>(chunk.at(static_cast<std::size_t>(i)));
    if (rank < 1 || bytes > most_chunk_bytes) fail(place, "has chunks of more than 256 MB");
  }
  return node;
}

void Input::check_storage(const Handle& set, const std::string& place, double bytes) const {
  const auto stored = static_cast<double>(H5Dget_storage_size(set.get()));
  if (bytes > most_bytes || bytes > 1e6 + stored * deflate_ratio)
    fail(place, "claims to hold more than is in the file");
}

Handle Input::open_numeric(const std::string& place, Size& size) const {
  auto set = open(place);
  const auto kind = type(H5Dget_type(set.get()));
  if (!is_number(kind)) fail(place, "must hold numbers");
  const auto extent = space(H5Dget_space(set.get()));
  const int rank = H5Sget_simple_extent_ndims(extent.get());
  if (rank != 1 && rank != 2) fail(place, "must have one dimension (raw counts: two)");
  std::array<hsize_t, 2> sizes{0, 0};
  H5Sget_simple_extent_dims(extent.get(), sizes.data(), nullptr);
  size = {sizes[0], sizes[1]};
  check_storage(set, place, elements(extent) * 8);
  return set;
}

Input::Size Input::numeric_size(const std::string& place) const {
  Size size;
  open_numeric(place, size);
  return size;
}

void Input::read_rows(const Handle& set, const std::string& place, hid_t type, std::size_t item, Size size,
                      void* data, const std::function<void(std::size_t)>& after_block) const {
  const auto extent = space(H5Dget_space(set.get()));
  const int rank = size.columns == 0 ? 1 : 2;
  const auto block = std::max(block_rows, chunk_rows(set));  // a chunk is unpacked as a whole
  for (std::uint64_t first = 0; first < size.rows; first += block) {
    const std::array<hsize_t, 2> start{first, 0};
    const std::array<hsize_t, 2> count{std::min(block, size.rows - first), size.columns};
    const auto memory = space(H5Screate_simple(rank, count.data(), nullptr));
    auto* to = static_cast<char*>(data) + first * std::max<std::uint64_t>(1, size.columns) * item;
    if (H5Sselect_hyperslab(extent.get(), H5S_SELECT_SET, start.data(), nullptr, count.data(), nullptr) < 0 ||
        H5Dread(set.get(), type, memory.get(), extent.get(), H5P_DEFAULT, to) < 0)
      fail(place, "could not be read", "its data are damaged, or packed by a filter that is not known here");
    if (after_block) after_block(first + count[0]);
  }
}

void Input::numbers(const std::string& place, std::span<double> to,
                    const std::function<void(std::size_t)>& after_block) const {
  Size size;
  const auto set = open_numeric(place, size);
  if (size.columns != 0) fail(place, "must have one dimension");
  if (size.rows < to.size()) fail(place, "is shorter than the others");
  read_rows(set, place, H5T_NATIVE_DOUBLE, sizeof(double), {to.size(), 0}, to.data(), after_block);
}

std::vector<double> Input::numbers(const std::string& place, std::uint64_t rows) const {
  if (rows > numeric_size(place).rows) fail(place, "is shorter than the others");
  std::vector<double> out(rows);
  numbers(place, out);
  return out;
}

double Input::span_of(const std::string& place, std::uint64_t rows) const {
  Size size;
  const auto set = open_numeric(place, size);
  const auto extent = space(H5Dget_space(set.get()));
  std::array<double, 2> ends{};
  const std::array<hsize_t, 2> points{0, rows - 1};
  const hsize_t count = points.size();
  const auto memory = space(H5Screate_simple(1, &count, nullptr));
  if (size.columns != 0 || rows == 0 || rows > size.rows ||
      H5Sselect_elements(extent.get(), H5S_SELECT_SET, points.size(), points.data()) < 0 ||
      H5Dread(set.get(), H5T_NATIVE_DOUBLE, memory.get(), extent.get(), H5P_DEFAULT, ends.data()) < 0)
    fail(place, "could not be read");
  return ends[1] - ends[0];
}

std::vector<std::int64_t> Input::integers(const std::string& place, std::uint64_t rows) const {
  std::vector<std::int64_t> out;
  for (const double value : numbers(place, rows)) {
    if (!(std::abs(value) < 9e15) || value != std::floor(value)) fail(place, "must hold whole numbers");
    out.push_back(static_cast<std::int64_t>(value));
  }
  return out;
}

void Input::counts(const std::string& place, std::size_t columns, std::span<std::int16_t> to) const {
  Size size;
  const auto set = open_numeric(place, size);
  if (size.columns != columns) fail(place, "must have two dimensions, the second of its channels");
  const auto rows = to.size() / columns;
  if (size.rows < rows) fail(place, "is shorter than the others");
  read_rows(set, place, H5T_NATIVE_INT16, sizeof(std::int16_t), {rows, columns}, to.data());
}

std::optional<double> Input::number(const std::string& place) const {
  if (!has(place)) return std::nullopt;
  const auto set = open(place);
  if (!is_number(type(H5Dget_type(set.get())))) fail(place, "must be a number");
  if (elements(space(H5Dget_space(set.get()))) != 1) fail(place, "must be one number");
  double value = 0;
  if (H5Dread(set.get(), H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, &value) < 0)
    fail(place, "could not be read");
  if (!std::isfinite(value)) fail(place, "must be a finite number");
  return value;
}

std::optional<std::int64_t> Input::integer(const std::string& place) const {
  if (!has(place)) return std::nullopt;
  const auto set = open(place);
  const auto kind = type(H5Dget_type(set.get()));
  std::int64_t whole = 0;
  if (is_number(kind) && H5Tget_class(kind.get()) == H5T_INTEGER &&
      elements(space(H5Dget_space(set.get()))) == 1 &&
      H5Dread(set.get(), H5T_NATIVE_INT64, H5S_ALL, H5S_ALL, H5P_DEFAULT, &whole) >= 0)
    return whole;
  const double value = *number(place);
  if (std::abs(value) > 9e15 || value != std::floor(value)) fail(place, "must be a whole number");
  return static_cast<std::int64_t>(value);
}

std::vector<std::string> Input::read_texts(const Handle& type, const Handle& extent, const Reader& read,
                                           const std::string& place) const {
  if (H5Tget_class(type.get()) != H5T_STRING) fail(place, "must be text");
  const double count = elements(extent);
  const bool variable = H5Tis_variable_str(type.get()) > 0;
  const auto width = variable ? sizeof(char*) : H5Tget_size(type.get());
  if (count * static_cast<double>(width) > most_text_bytes) fail(place, "is too long");
  std::vector<std::string> out(static_cast<std::size_t>(count));
  auto memory = hdf5::type(H5Tcopy(type.get()));  // character set and padding as they are
  if (variable) {
    std::vector<char*> texts(out.size(), nullptr);
    const bool done = out.empty() || read(memory.get(), static_cast<void*>(texts.data())) >= 0;
    for (std::size_t i = 0; done && i < out.size(); ++i)
      if (texts[i] != nullptr)
        out[i] = utf8({texts[i], strnlen(texts[i], static_cast<std::size_t>(most_text_bytes))});
    H5Dvlen_reclaim(memory.get(), extent.get(), H5P_DEFAULT, static_cast<void*>(texts.data()));
    if (!done) fail(place, "could not be read");
  } else {
    std::string table(out.size() * width, '\0');
    if (!out.empty() && read(memory.get(), table.data()) < 0) fail(place, "could not be read");
    for (std::size_t i = 0; i < out.size(); ++i) {
      auto item = std::string_view(table).substr(i * width, width);
      item = item.substr(0, item.find('\0'));
      if (H5Tget_strpad(type.get()) == H5T_STR_SPACEPAD)
        while (item.ends_with(' ')) item.remove_suffix(1);
      out[i] = utf8(item);
    }
  }
  return out;
}

std::vector<std::string> Input::texts(const std::string& place) const {
  const auto set = open(place);
  const auto kind = type(H5Dget_type(set.get()));
  const auto extent = space(H5Dget_space(set.get()));
  check_storage(set, place, elements(extent) * static_cast<double>(H5Tget_size(kind.get())));
  return read_texts(
      kind, extent,
      [&](hid_t memory, void* data) {
        return H5Dread(set.get(), memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, data);
      },
      place);
}

std::optional<std::string> Input::text(const std::string& place) const {
  if (!has(place)) return std::nullopt;
  auto all = texts(place);
  if (all.size() != 1) fail(place, "must be one text");
  return std::move(all.front());
}

Handle Input::open_attribute(const std::string& place, const char* name) const {
  if (!has(place) || H5Aexists_by_name(file_.get(), place.c_str(), name, H5P_DEFAULT) <= 0) return {};
  auto found = attribute(H5Aopen_by_name(file_.get(), place.c_str(), name, H5P_DEFAULT, H5P_DEFAULT));
  if (!found) fail(place + "@" + name, "could not be read");
  return found;
}

std::vector<std::string> Input::text_attributes(const std::string& place, const char* name) const {
  const auto found = open_attribute(place, name);
  if (!found) return {};
  return read_texts(
      type(H5Aget_type(found.get())), space(H5Aget_space(found.get())),
      [&](hid_t memory, void* data) { return H5Aread(found.get(), memory, data); }, place + "@" + name);
}

std::vector<double> Input::number_attributes(const std::string& place, const char* name) const {
  const auto found = open_attribute(place, name);
  if (!found) return {};
  if (!is_number(type(H5Aget_type(found.get())))) fail(place + "@" + name, "must hold numbers");
  const double count = elements(space(H5Aget_space(found.get())));
  if (count > 1e4) fail(place + "@" + name, "is too long");
  std::vector<double> out(static_cast<std::size_t>(count));
  if (!out.empty() && H5Aread(found.get(), H5T_NATIVE_DOUBLE, out.data()) < 0)
    fail(place + "@" + name, "could not be read");
  return out;
}

std::optional<std::string> Input::text_attribute(const std::string& place, const char* name) const {
  const auto found = open_attribute(place, name);
  if (!found) return std::nullopt;
  if (H5Tget_class(type(H5Aget_type(found.get())).get()) != H5T_STRING) {
    const auto values = number_attributes(place, name);
    if (values.size() != 1) fail(place + "@" + name, "must be one value");
    return nlohmann::json(values.front()).dump();
  }
  auto all = text_attributes(place, name);
  if (all.size() != 1) fail(place + "@" + name, "must be one text");
  return std::move(all.front());
}

}  // namespace ferrobench::recordings::hdf5
