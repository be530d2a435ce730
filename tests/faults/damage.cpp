#include "tests/faults/damage.h"

#include <unistd.h>

#include <cmath>
#include <cstring>
#include <fstream>
#include <iterator>
#include <optional>
#include <random>
#include <sstream>

#include "daq/replay/play.h"
#include "recordings/exchange/export.h"
#include "recordings/exchange/import_csv.h"
#include "recordings/file/reader.h"
#include "recordings/file/recover.h"
#include "recordings/file/writer.h"
#include "recordings/hdf5/handle.h"
#include "recordings/reports/report.h"

namespace ferrobench::faults {

namespace fs = std::filesystem;
using recordings::Channel;
using recordings::Recording;

namespace {

constexpr unsigned patience = 300;  // s for one file, on a slow machine under a sanitizer

constexpr std::size_t sample_rows = 400;

Recording sample() {
  constexpr auto rows = sample_rows;
  Recording r;
  r.header.title = "sample";
  r.header.start_time = r.end_time = "2026-01-01T00:00:00.000000Z";
  r.header.entry_identifier = "0d6ac1fe-0000-4000-8000-000000000001";
  r.header.run_seed = 7;
  r.header.protocol = {{"format", "ferrobench-protocol"}, {"name", "sample"}};
  r.header.device = {{"driver", "virtual"}, {"sample_rate", 200.0}};
  r.header.specimen = {"a stack", 0.01, 2.5e-5, 1e-4, 100};
  r.header.load = {2.7e6, 8e6};
  auto& raw = r.raw.emplace();
  raw.columns = {{Channel::field, 64, 0}, {Channel::charge, 1e-8, 1e-6}, {Channel::displacement, 1e-9, 0}};
  auto& command = r.set(Channel::command);
  for (const auto& column : raw.columns) r.set(column.channel);
  for (std::size_t i = 0; i < rows; ++i) {
    r.time.push_back(static_cast<double>(i) / 200);
    const double level = i < 100   ? 1e4 * static_cast<double>(i)
                         : i < 300 ? 1e6
                                   : 1e4 * static_cast<double>(399 - i);
    command.push_back(level);
    for (const auto& column : raw.columns) {
      raw.counts.push_back(static_cast<std::int16_t>(std::lround(level / 64) + static_cast<long>(i % 3)));
      r.channels[static_cast<std::size_t>(column.channel)]->push_back(column.offset +
                                                                      column.gain * raw.counts.back());
    }
  }
  r.segments = {
      {0, 100, "ramp", "up", 1e6, 2e6}, {100, 300, "hold", "", 1e6, 0}, {300, 400, "ramp", "down", 0, 2e6}};
  r.events = {{0.5, "note", "here"}, {1, "clipped", "charge is past the converter's range"}};
  r.noise[0] = 1e-3;
  return r;
}

std::string slurp(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

namespace h5 = recordings::hdf5;

std::string bytes_of(hid_t type, hid_t space) {
  return std::string(static_cast<std::size_t>(H5Sget_simple_extent_npoints(space)) * H5Tget_size(type), '\0');
}

void copy_attributes(hid_t from, hid_t to) {
  H5O_info_t info;
  H5Oget_info(from, &info);
  for (hsize_t i = 0; i < info.num_attrs; ++i) {
    const auto source =
        h5::attribute(H5Aopen_by_idx(from, ".", H5_INDEX_NAME, H5_ITER_INC, i, H5P_DEFAULT, H5P_DEFAULT));
    const auto type = h5::type(H5Aget_type(source.get()));
    const auto space = h5::space(H5Aget_space(source.get()));
    std::array<char, 100> name{};
    H5Aget_name(source.get(), name.size(), name.data());
    auto bytes = bytes_of(type.get(), space.get());
    H5Aread(source.get(), type.get(), bytes.data());
    const auto target =
        h5::attribute(H5Acreate2(to, name.data(), type.get(), space.get(), H5P_DEFAULT, H5P_DEFAULT));
    H5Awrite(target.get(), type.get(), bytes.data());
  }
}

// A chunk is compressed once, and stands for all. `width` of a row; 0: the dataset has one dimension.
void write_chunks(hid_t dataset, hid_t type, std::uint64_t rows, hsize_t width, hsize_t chunk) {
  const std::array<hsize_t, 2> size{chunk, width}, origin{0, 0};
  const int rank = width == 0 ? 1 : 2;
  const auto one = h5::space(H5Screate_simple(rank, size.data(), nullptr));
  const auto all = h5::space(H5Dget_space(dataset));
  H5Sselect_hyperslab(all.get(), H5S_SELECT_SET, origin.data(), nullptr, size.data(), nullptr);
  const std::string bytes(static_cast<std::size_t>(chunk * std::max<hsize_t>(width, 1)) * H5Tget_size(type),
                          '\0');
  H5Dwrite(dataset, type, one.get(), all.get(), H5P_DEFAULT, bytes.data());
  H5Dflush(dataset);
  hsize_t stored = 0;
  H5Dget_chunk_storage_size(dataset, origin.data(), &stored);
  std::uint32_t filters = 0;
  std::string packed(stored, '\0');
  H5Dread_chunk(dataset, H5P_DEFAULT, origin.data(), &filters, packed.data());
  for (std::array<hsize_t, 2> at{chunk, 0}; at[0] < rows; at[0] += chunk)
    H5Dwrite_chunk(dataset, H5P_DEFAULT, filters, at.data(), packed.size(), packed.data());
}

// The samples' datasets with so many rows of zeros.
void copy_with_zeros(hid_t source, hid_t to, const std::string& name, std::uint64_t rows) {
  const auto type = h5::type(H5Dget_type(source));
  const auto space = h5::space(H5Dget_space(source));
  std::array<hsize_t, 2> size{}, chunk{hsize_t{1} << 20, 0};
  const int rank = H5Sget_simple_extent_dims(space.get(), size.data(), nullptr);
  size[0] = rows;
  chunk[1] = size[1];
  const auto how = h5::properties(H5Pcreate(H5P_DATASET_CREATE));
  H5Pset_chunk(how.get(), rank, chunk.data());
  H5Pset_deflate(how.get(), 9);
  const auto larger = h5::space(H5Screate_simple(rank, size.data(), nullptr));
  const auto target = h5::dataset(
      H5Dcreate2(to, name.c_str(), type.get(), larger.get(), H5P_DEFAULT, how.get(), H5P_DEFAULT));
  write_chunks(target.get(), type.get(), rows, size[1], chunk[0]);
  copy_attributes(source, target.get());
}

bool is_of_samples(hid_t dataset, std::size_t rows) {
  const auto space = h5::space(H5Dget_space(dataset));
  std::array<hsize_t, 2> size{};
  return H5Sget_simple_extent_ndims(space.get()) > 0 &&
         H5Sget_simple_extent_dims(space.get(), size.data(), nullptr) > 0 && size[0] == rows;
}

// Many small chunks; the title as text of variable length, as Python writes it.
void copy_dataset(hid_t source, hid_t to, const std::string& name) {
  auto type = h5::type(H5Dget_type(source));
  const auto space = h5::space(H5Dget_space(source));
  auto bytes = bytes_of(type.get(), space.get());
  H5Dread(source, type.get(), H5S_ALL, H5S_ALL, H5P_DEFAULT, bytes.data());
  const auto how = h5::properties(H5Pcreate(H5P_DATASET_CREATE));
  std::array<hsize_t, 2> size{};
  const int rank = H5Sget_simple_extent_dims(space.get(), size.data(), nullptr);
  if (rank > 0 && size[0] > 100) {
    const std::array<hsize_t, 2> chunk{64, size[1]};
    H5Pset_chunk(how.get(), rank, chunk.data());
    H5Pset_shuffle(how.get());
    H5Pset_deflate(how.get(), 6);
  }
  const char* text = bytes.c_str();
  const bool variable = name == "title";
  if (variable) type = h5::type(H5Tcopy(H5T_C_S1)), H5Tset_size(type.get(), H5T_VARIABLE);
  const auto target =
      h5::dataset(H5Dcreate2(to, name.c_str(), type.get(), space.get(), H5P_DEFAULT, how.get(), H5P_DEFAULT));
  H5Dwrite(target.get(), type.get(), H5S_ALL, H5S_ALL, H5P_DEFAULT,
           variable ? static_cast<const void*>(&text) : bytes.data());
  copy_attributes(source, target.get());
}

// `zeros`: so many rows of them take the place of the samples.
void copy_group(hid_t from, hid_t to, std::optional<std::uint64_t> zeros = {}) {
  copy_attributes(from, to);
  H5G_info_t info;
  H5Gget_info(from, &info);
  for (hsize_t i = 0; i < info.nlinks; ++i) {
    std::array<char, 100> name{};
    H5Lget_name_by_idx(from, ".", H5_INDEX_NAME, H5_ITER_INC, i, name.data(), name.size(), H5P_DEFAULT);
    const auto source = h5::object(H5Oopen(from, name.data(), H5P_DEFAULT));
    if (H5Iget_type(source.get()) == H5I_DATASET && zeros && is_of_samples(source.get(), sample_rows)) {
      copy_with_zeros(source.get(), to, name.data(), *zeros);
    } else if (H5Iget_type(source.get()) == H5I_DATASET) {
      copy_dataset(source.get(), to, name.data());
    } else {
      const auto target = h5::group(H5Gcreate2(to, name.data(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT));
      copy_group(source.get(), target.get(), zeros);
    }
  }
}

// As a program writes it that asks for nothing special: the oldest layout, without checksums.
void copy_plainly(const std::string& from, const std::string& to, std::optional<std::uint64_t> zeros = {}) {
  h5::prepare_thread();
  const auto source = h5::file(H5Fopen(from.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT));
  const auto target = h5::file(H5Fcreate(to.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT));
  copy_group(source.get(), target.get(), zeros);
}

std::string journal_of(const Recording& r, const std::string& path) {
  std::vector<Channel> channels;
  for (const auto channel : recordings::all_channels)
    if (r.has(channel)) channels.push_back(channel);
  std::string out;
  recordings::Writer writer(path, r.header, channels, r.raw->columns);
  constexpr std::size_t block = 50;
  for (std::size_t first = 0; first < r.size(); first += block) {
    recordings::Rows rows{.time = std::span(r.time).subspan(first, block), .channels = {}, .counts = {}};
    for (const auto channel : channels)
      rows.channels[static_cast<std::size_t>(channel)] = std::span(r.at(channel)).subspan(first, block);
    const auto width = r.raw->columns.size();
    rows.counts = std::span(r.raw->counts).subspan(width * first, width * block);
    writer.append(rows);
    if (first == 2 * block) writer.add_event(r.events[0]);
  }
  writer.flush();
  out = slurp(path + ".journal");
  writer.discard();
  return out;
}

recordings::CsvImport columns_of(std::string csv) {
  recordings::CsvImport import;
  import.csv = std::move(csv);
  import.title = "imported";
  import.time = {.column = "time_s"};
  import.command = {.column = "command_V_per_m"};
  import.field = {.column = "field_V_per_m"};
  import.charge = {.column = "charge_C"};
  import.displacement = {.column = "displacement_m"};
  import.specimen = "a stack";
  import.length = 0.01, import.area = 2.5e-5, import.layer_thickness = 1e-4, import.layer_count = 100;
  return import;
}

using Random = std::mt19937_64;

std::string damaged(std::string bytes, Random& random) {
  const auto below = [&random](std::size_t count) { return static_cast<std::size_t>(random() % count); };
  const auto kind = below(8);
  if (kind == 0) return bytes.substr(0, below(bytes.size()));
  for (auto times = 1 + below(kind < 4 ? 8 : 2); times > 0; --times) {
    const auto at = below(bytes.size()), length = std::min(1 + below(32), bytes.size() - at);
    if (kind < 4) {
      bytes[at] = static_cast<char>(bytes[at] ^ (1 << below(8)));
    } else if (kind < 6) {
      const int with = static_cast<int>(below(3));
      for (std::size_t i = at; i < at + length; ++i)
        bytes[i] = with == 0 ? '\0' : with == 1 ? '\xff' : static_cast<char>(below(256));
    } else {
      const auto piece = bytes.substr(below(bytes.size()), length);
      bytes.replace(at, piece.size(), piece);
    }
  }
  return bytes;
}

// The HDF5 library's own; declared in none of its headers.
extern "C" std::uint32_t H5_checksum_metadata(const void* data, std::size_t bytes, std::uint32_t initial);

// A part of a file, from its mark on, that a checksum of four bytes follows.
struct Checked {
  std::size_t at, bytes;
};

std::uint32_t checksum_of(const std::string& file, const Checked& part) {
  return H5_checksum_metadata(file.data() + part.at, part.bytes, 0);
}

// The headers of objects and the indices of groups and chunks: as long as makes their checksum right.
std::vector<Checked> checked_parts(const std::string& file) {
  constexpr std::size_t longest = 4096;
  std::vector<Checked> out;
  for (const std::string_view mark : {"\x89HDF", "OHDR", "OCHK", "FRHP", "FHDB", "FHIB", "BTHD", "BTLF",
                                      "FAHD", "FADB", "EAHD", "EAIB", "EADB"})
    for (auto at = file.find(mark); at != std::string::npos; at = file.find(mark, at + 1))
      for (Checked part{at, mark.size()}; part.bytes < longest && at + part.bytes + 4 <= file.size();
           ++part.bytes) {
        std::uint32_t written = 0;
        std::memcpy(&written, file.data() + at + part.bytes, sizeof written);
        if (written != checksum_of(file, part)) continue;
        out.push_back(part);
        break;
      }
  return out;
}

// Bits turned or a few bytes overwritten in one or two of these parts, and their checksums made right again.
std::string forged(std::string file, const std::vector<Checked>& parts, Random& random) {
  const auto below = [&random](std::size_t count) { return static_cast<std::size_t>(random() % count); };
  for (auto times = 1 + below(2); times > 0; --times) {
    const auto& part = parts[below(parts.size())];
    for (auto changes = 1 + below(3); changes > 0; --changes) {
      auto& byte = file[part.at + 4 + below(part.bytes - 4)];
      const auto how = below(4);
      byte = static_cast<char>(how == 0 ? 0 : how == 1 ? 0xff : byte ^ (1 << below(8)));
    }
    const auto right = checksum_of(file, part);
    std::memcpy(file.data() + part.at + part.bytes, &right, sizeof right);
  }
  return file;
}

// What is found wrong is thrown as this.
struct Wrong : std::runtime_error {
  using std::runtime_error::runtime_error;
};

class Bench {
 public:
  Bench(const fs::path& folder, std::uint64_t seed)
      : folder_(folder),
        random_(seed),
        forger_(seed),
        whole_(sample()),
        sources_(sound_files(folder)),
        parts_(checked_parts(sources_[static_cast<std::size_t>(DamagedKind::recording)])) {}

  void damage(int number, DamageFigures& figures) {
    const auto kind = static_cast<DamagedKind>(number % 5);
    auto& row = figures.rows.at(static_cast<std::size_t>(kind));
    const auto bytes = kind == DamagedKind::forged_recording
                           ? forged(sources_[0], parts_, forger_)
                           : damaged(sources_.at(static_cast<std::size_t>(kind)), random_);
    const auto path = (folder_ / ("damaged-" + std::to_string(number) + ".h5")).string();
    const auto file = kind == DamagedKind::journal ? path + ".journal" : path;
    std::ofstream(file, std::ios::binary) << bytes;
    ++row.files;
    alarm(patience);
    bool good = true;
    try {
      if (const auto read = read_anyhow(kind, path, bytes)) {
        ++row.read;
        row.replayed += replay(*read) ? 1 : 0;
      } else {
        ++row.refused;
      }
    } catch (const std::exception& error) {
      figures.failures.push_back(file + ": " + error.what());
      good = false;
    }
    alarm(0);
    for (const auto& left : {path, path + ".journal", path + ".journal.damaged"})
      if (good) fs::remove(left);
  }

 private:
  // Nothing if it was refused.
  std::optional<Recording> read_anyhow(DamagedKind kind, const std::string& path,
                                       const std::string& bytes) const {
    try {
      Recording r;
      if (kind == DamagedKind::csv) {
        r = recordings::import_csv(columns_of(bytes));
      } else {
        recordings::read_summary(path);
        r = recordings::read_recording(path);
      }
      if (kind == DamagedKind::journal) {
        recordings::recover_recording(path);
        if (!fs::exists(path)) return std::nullopt;  // nothing had been recorded
        r = recordings::read_recording(path);
        demand_part(r);
      }
      const auto report = make_report(r);
      for (const auto format : {recordings::Format::text, recordings::Format::json}) render(report, format);
      std::ostringstream text;
      export_json(r, text);
      return r;
    } catch (const Error&) {
      return std::nullopt;
    }
  }

  // A journal has checksums: what is left of it is what was written.
  void demand_part(const Recording& r) const {
    if (r.size() > whole_.size() || !std::equal(r.time.begin(), r.time.end(), whole_.time.begin()))
      throw Wrong("times were invented");
    for (const auto channel : recordings::all_channels) {
      if (r.has(channel) != whole_.has(channel)) throw Wrong("a channel is missing");
      if (r.has(channel) &&
          !std::equal(r.at(channel).begin(), r.at(channel).end(), whole_.at(channel).begin()))
        throw Wrong("samples were invented");
    }
  }

  static bool replay(const Recording& r) {
    daq::ReplayConfig config;
    config.clock = daq::Clock::fast;
    try {
      daq::ReplayDevice device(r, config);
      const auto replay = daq::play(device, daq::Limits{});
      if (!replay.outcome.output_at_zero || device.output() != 0) throw Wrong("the output is not at zero");
      return replay.outcome.end == daq::End::complete;
    } catch (const Error&) {
      return false;
    }
  }

  fs::path folder_;
  Random random_, forger_;
  Recording whole_;
  std::array<std::string, 4> sources_;
  std::vector<Checked> parts_;
};

}  // namespace

std::array<std::string, 4> sound_files(const fs::path& folder) {
  fs::create_directories(folder);
  const auto r = sample();
  const auto path = (folder / "whole.h5").string(), plain = (folder / "plain.h5").string();
  recordings::write_recording(path, r);
  copy_plainly(path, plain);
  std::ostringstream csv;
  export_csv(r, csv);
  for (const auto& sound : {path, plain}) recordings::read_recording(sound);
  recordings::import_csv(columns_of(csv.str()));
  return {slurp(path), slurp(plain), journal_of(r, (folder / "journal.h5").string()), csv.str()};
}

std::vector<std::string> forged_files(int files, std::uint64_t seed, const fs::path& folder) {
  const auto sound = sound_files(folder)[static_cast<std::size_t>(DamagedKind::recording)];
  const auto parts = checked_parts(sound);
  Random random(seed);
  std::vector<std::string> out;
  while (out.size() < static_cast<std::size_t>(files)) out.push_back(forged(sound, parts, random));
  return out;
}

void write_zeros(std::uint64_t rows, const std::string& path, const fs::path& folder) {
  sound_files(folder);
  copy_plainly((folder / "whole.h5").string(), path, rows);
}

DamageFigures damage_files(int files, std::uint64_t seed, const fs::path& folder) {
  DamageFigures figures;
  Bench bench(folder, seed);
  for (int i = 0; i < files; ++i) bench.damage(i, figures);
  return figures;
}

std::ostream& operator<<(std::ostream& out, const DamageFigures& figures) {
  constexpr std::array names{"recordings", "recordings without checksums", "journals", "CSV tables",
                             "recordings with right checksums"};
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto& row = figures.rows.at(i);
    out << names.at(i) << ": " << row.files << " damaged, " << row.refused << " refused, " << row.read
        << " read, " << row.replayed << " of them replayed\n";
  }
  for (const auto& failure : figures.failures) out << "FAILED " << failure << "\n";
  return out << figures.failures.size() << " failures\n";
}

}  // namespace ferrobench::faults
