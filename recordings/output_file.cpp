#include "recordings/output_file.h"

#include "recordings/version.h"

namespace ferrobench::recordings {
namespace {

using Kind = OutputFile::Kind;

hdf5::Handle create(const std::string& path, Kind kind) {
  hdf5::prepare_thread();
  auto access = hdf5::unlocked_access();
  // Version 1.10 puts checksums on everything, but marks an open file, which a crash would leave so.
  const auto version = kind == Kind::packed ? H5F_LIBVER_V110 : H5F_LIBVER_V18;
  H5Pset_libver_bounds(access.get(), version, version);
  auto creation = hdf5::properties(H5Pcreate(H5P_FILE_CREATE));
  H5Pset_obj_track_times(creation.get(), false);
  auto file = hdf5::file(H5Fcreate(path.c_str(), kind == Kind::packed ? H5F_ACC_TRUNC : H5F_ACC_EXCL,
                                   creation.get(), access.get()));
  if (file && kind == Kind::growing) {
    // Structure reaches the disk at a flush only: in between, the file there stays as the last flush left it.
    H5AC_cache_config_t cache{};
    cache.version = H5AC__CURR_CACHE_CONFIG_VERSION;
    if (H5Fget_mdc_config(file.get(), &cache) >= 0) {
      cache.evictions_enabled = false;
      cache.incr_mode = H5C_incr__off;
      cache.flash_incr_mode = H5C_flash_incr__off;
      cache.decr_mode = H5C_decr__off;
      H5Fset_mdc_config(file.get(), &cache);
    }
  }
  return file;
}

// The channel that a viewer shows first.
std::string_view default_signal(std::span<const Channel> channels) {
  for (const auto wanted : {Channel::displacement, Channel::charge, Channel::force, Channel::field})
    if (std::ranges::find(channels, wanted) != channels.end()) return channel_name(wanted);
  return channel_name(Channel::command);
}

const char* long_name(Channel channel) {
  switch (channel) {
    case Channel::command:
      return "electric field, commanded";
    case Channel::field:
      return "electric field, measured";
    case Channel::charge:
      return "charge";
    case Channel::displacement:
      return "displacement";
    case Channel::force:
      return "force on the load cell";
  }
  return "";
}

constexpr std::size_t kind_bytes = 64, message_bytes = 1024;  // of an event in a growing file

template <class T>
void transfer(herr_t (*move)(hid_t, hid_t, hid_t, hid_t, hid_t, T*), const hdf5::Output& out,
              const hdf5::Handle& column, hid_t type, std::uint64_t first, std::uint64_t rows,
              std::size_t width, T* data, const std::string& place) {
  const auto file_space = hdf5::space(H5Dget_space(column.get()));
  const std::array<hsize_t, 2> start{first, 0};
  const std::array<hsize_t, 2> count{rows, width};
  const auto memory = hdf5::space(H5Screate_simple(width == 0 ? 1 : 2, count.data(), nullptr));
  out.need(H5Sselect_hyperslab(file_space.get(), H5S_SELECT_SET, start.data(), nullptr, count.data(),
                               nullptr) >= 0 &&
               move(column.get(), type, memory.get(), file_space.get(), H5P_DEFAULT, data) >= 0,
           place);
}

}  // namespace

std::string channel_place(Channel channel) {
  return "/entry/data/" + std::string(channel_name(channel));
}

OutputFile::OutputFile(const std::string& path, Kind kind, const Header& header,
                       std::span<const Channel> channels, std::span<const RawColumn> raw, std::uint64_t rows)
    : kind_(kind), rows_(rows), raw_width_(raw.size()), out_(create(path, kind), path) {
  write_header(header);
  make_columns(header, channels);
  out_.group("/entry/events", "NXcollection");
  if (kind == Kind::growing) make_events();
  if (!raw.empty()) make_raw(raw);
}

void OutputFile::write_header(const Header& header) {
  out_.attribute("/", "NX_class", std::string("NXroot"));
  out_.attribute("/", "default", std::string("entry"));
  out_.attribute("/", "creator", std::string("ferrobench"));
  out_.attribute("/", "creator_version", std::string(software_version()));
  out_.attribute("/", "creator_commit", std::string(software_commit()));
  out_.group("/entry", "NXentry");
  out_.attribute("/entry", "default", std::string("data"));
  out_.text("/entry/definition", "ferrobench_recording");
  out_.attribute("/entry/definition", "version", 1);
  out_.text("/entry/title", header.title);
  out_.text("/entry/start_time", header.start_time);
  out_.text("/entry/entry_identifier", header.entry_identifier);
  if (header.run_seed) out_.integer("/entry/run_seed", *header.run_seed);
  const auto json = [&](const char* place, const nlohmann::json& value) {
    if (!value.is_null())
      out_.text(place, value.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
  };
  json("/entry/protocol", header.protocol);
  json("/entry/model", header.model);

  out_.group("/entry/sample", "NXsample");
  out_.text("/entry/sample/name", header.specimen.name);
  out_.number("/entry/sample/length_m", header.specimen.length, "m");
  out_.number("/entry/sample/area_m2", header.specimen.area, "m^2");
  out_.number("/entry/sample/layer_thickness_m", header.specimen.layer_thickness, "m");
  out_.integer("/entry/sample/layer_count", header.specimen.layer_count);
  out_.group("/entry/load", "NXcollection");
  out_.number("/entry/load/spring_stiffness_N_per_m", header.load.spring_stiffness, "N/m");
  out_.number("/entry/load/prestress_Pa", header.load.prestress, "Pa");
  out_.group("/entry/instrument", "NXinstrument");
  json("/entry/instrument/device", header.device);
}

hdf5::Handle OutputFile::make_column(const std::string& place, hid_t type, std::size_t width) {
  const bool growing = kind_ == Kind::growing;
  const int rank = width == 0 ? 1 : 2;
  const std::array<hsize_t, 2> size{rows_, width};
  const std::array<hsize_t, 2> limit{growing ? H5S_UNLIMITED : rows_, width};
  const std::array<hsize_t, 2> chunk{growing ? chunk_rows : std::clamp<hsize_t>(rows_, 1, 4 * chunk_rows),
                                     width};
  auto properties = hdf5::properties(H5Pcreate(H5P_DATASET_CREATE));
  H5Pset_obj_track_times(properties.get(), false);
  H5Pset_chunk(properties.get(), rank, chunk.data());
  if (!growing) {
    H5Pset_shuffle(properties.get());
    H5Pset_deflate(properties.get(), 2);
    H5Pset_fletcher32(properties.get());
  }
  const auto space = hdf5::space(H5Screate_simple(rank, size.data(), limit.data()));
  auto column = hdf5::dataset(
      H5Dcreate2(out_.id(), place.c_str(), type, space.get(), H5P_DEFAULT, properties.get(), H5P_DEFAULT));
  out_.need(static_cast<bool>(column), place);
  return column;
}

void OutputFile::make_columns(const Header& header, std::span<const Channel> channels) {
  out_.group("/entry/data", "NXdata");
  out_.attribute("/entry/data", "signal", std::string(default_signal(channels)));
  out_.attribute("/entry/data", "axes", std::string("time"));
  time_ = make_column("/entry/data/time", H5T_NATIVE_DOUBLE, 0);
  out_.attribute("/entry/data/time", "units", std::string("s"));
  out_.attribute("/entry/data/time", "long_name", std::string("time"));
  for (const auto channel : channels) {
    const auto place = channel_place(channel);
    columns_.at(static_cast<std::size_t>(channel)) = make_column(place, H5T_NATIVE_DOUBLE, 0);
    out_.attribute(place, "units", std::string(channel_unit(channel)));
    out_.attribute(place, "long_name", std::string(long_name(channel)));
    if (channel == Channel::charge)
      out_.attribute(
          place, "reference",
          std::string(header.charge_reference == ChargeReference::absolute ? "absolute" : "first_sample"));
  }
}

void OutputFile::make_raw(std::span<const RawColumn> raw) {
  const std::string place = "/entry/instrument/raw/ai";
  out_.group("/entry/instrument/raw", "NXcollection");
  counts_ = make_column(place, H5T_NATIVE_INT16, raw.size());
  std::vector<std::string> names, units;
  std::vector<double> gains, offsets;
  for (const auto& column : raw) {
    names.emplace_back(channel_name(column.channel));
    units.emplace_back(channel_unit(column.channel));
    gains.push_back(column.gain);
    offsets.push_back(column.offset);
  }
  out_.attribute(place, "long_name",
                 std::string("counts; SI value = offset + gain * count, column by column"));
  out_.attribute(place, "channels", std::span<const std::string>(names));
  out_.attribute(place, "channel_units", std::span<const std::string>(units));
  out_.attribute(place, "gain", std::span<const double>(gains));
  out_.attribute(place, "offset", std::span<const double>(offsets));
}

void OutputFile::make_events() {
  const hsize_t none = 0, chunk = 64, unlimited = H5S_UNLIMITED;
  const auto space = hdf5::space(H5Screate_simple(1, &none, &unlimited));
  const auto properties = hdf5::properties(H5Pcreate(H5P_DATASET_CREATE));
  H5Pset_obj_track_times(properties.get(), false);
  H5Pset_chunk(properties.get(), 1, &chunk);
  const auto kind = hdf5::text_type(kind_bytes), message = hdf5::text_type(message_bytes);
  for (const auto& [place, type] :
       {std::pair{"/entry/events/time", H5T_NATIVE_DOUBLE}, std::pair{"/entry/events/kind", kind.get()},
        std::pair{"/entry/events/message", message.get()}})
    out_.need(static_cast<bool>(hdf5::dataset(H5Dcreate2(out_.id(), place, type, space.get(), H5P_DEFAULT,
                                                         properties.get(), H5P_DEFAULT))),
              place);
  out_.attribute("/entry/events/time", "units", std::string("s"));
}

void OutputFile::add_event(const Event& event) {
  const hsize_t size = events_ + 1;
  const auto add = [&](const char* place, hid_t type, const void* value) {
    const auto column = hdf5::dataset(H5Dopen2(out_.id(), place, H5P_DEFAULT));
    out_.need(column && H5Dset_extent(column.get(), &size) >= 0, place);
    transfer(&H5Dwrite, out_, column, type, events_, 1, 0, value, place);
  };
  const auto add_text = [&](const char* place, std::string text, std::size_t bytes) {
    text.resize(bytes, '\0');
    add(place, hdf5::text_type(bytes).get(), text.data());
  };
  add("/entry/events/time", H5T_NATIVE_DOUBLE, &event.time);
  add_text("/entry/events/kind", event.kind, kind_bytes);
  add_text("/entry/events/message", event.message, message_bytes);
  ++events_;
}

void OutputFile::write_events(std::span<const Event> events) {
  std::vector<double> times;
  std::vector<std::string> kinds, messages;
  for (const auto& event : events) {
    times.push_back(event.time);
    kinds.push_back(event.kind);
    messages.push_back(event.message);
  }
  out_.numbers("/entry/events/time", times, "s");
  out_.texts("/entry/events/kind", kinds);
  out_.texts("/entry/events/message", messages);
}

void OutputFile::write(std::uint64_t first, const Rows& rows) {
  const auto count = rows.time.size();
  if (count == 0) return;
  const auto put = [&](const hdf5::Handle& column, hid_t type, std::size_t width, const void* data,
                       const std::string& place) {
    if (first + count > rows_) {
      const std::array<hsize_t, 2> size{first + count, width};
      out_.need(H5Dset_extent(column.get(), size.data()) >= 0, place);
    }
    transfer(&H5Dwrite, out_, column, type, first, count, width, data, place);
  };
  put(time_, H5T_NATIVE_DOUBLE, 0, rows.time.data(), "/entry/data/time");
  for (const auto channel : all_channels) {
    const auto i = static_cast<std::size_t>(channel);
    if (columns_.at(i))
      put(columns_.at(i), H5T_NATIVE_DOUBLE, 0, rows.channels.at(i).data(), channel_place(channel));
  }
  if (counts_) put(counts_, H5T_NATIVE_INT16, raw_width_, rows.counts.data(), "/entry/instrument/raw/ai");
  rows_ = std::max<std::uint64_t>(rows_, first + count);
}

void OutputFile::read(std::uint64_t first, std::span<double> time,
                      const std::array<std::span<double>, 5>& channels,
                      std::span<std::int16_t> counts) const {
  const auto get = [&](const hdf5::Handle& column, hid_t type, std::size_t width, void* data,
                       const std::string& place) {
    transfer(&H5Dread, out_, column, type, first, time.size(), width, data, place);
  };
  get(time_, H5T_NATIVE_DOUBLE, 0, time.data(), "/entry/data/time");
  for (const auto channel : all_channels) {
    const auto i = static_cast<std::size_t>(channel);
    if (columns_.at(i))
      get(columns_.at(i), H5T_NATIVE_DOUBLE, 0, channels.at(i).data(), channel_place(channel));
  }
  if (counts_) get(counts_, H5T_NATIVE_INT16, raw_width_, counts.data(), "/entry/instrument/raw/ai");
}

void OutputFile::write_status(const std::string& status, const std::string& reason) {
  out_.remove("/entry/status");
  out_.text("/entry/status", status);
  if (!reason.empty()) out_.fixed_attribute("/entry/status", "reason", reason);
}

void OutputFile::write_closing(const Closing& closing) {
  out_.text("/entry/end_time", closing.end_time);
  write_status(closing.status, closing.reason);

  std::vector<std::int64_t> starts, ends;
  std::vector<std::string> kinds, labels;
  std::vector<double> levels, rates;
  for (const auto& row : closing.segments) {
    starts.push_back(row.start_sample);
    ends.push_back(row.end_sample);
    kinds.push_back(row.kind);
    labels.push_back(row.label);
    levels.push_back(row.level);
    rates.push_back(row.rate);
  }
  if (!starts.empty()) {
    out_.group("/entry/segments", "NXcollection");
    out_.integers("/entry/segments/start_sample", starts);
    out_.integers("/entry/segments/end_sample", ends);
    out_.texts("/entry/segments/kind", kinds);
    out_.texts("/entry/segments/label", labels);
    out_.numbers("/entry/segments/level", levels, "V/m");
    out_.numbers("/entry/segments/rate", rates, "V/m/s");
  }
  out_.group("/entry/noise", "NXcollection");
  for (const auto channel : all_channels)
    if (const auto& value = closing.noise.at(static_cast<std::size_t>(channel)))
      out_.number("/entry/noise/" + std::string(channel_name(channel)), *value,
                  std::string(channel_unit(channel)));
}

void OutputFile::close() {
  time_.close();
  for (auto& column : columns_) column.close();
  counts_.close();
  out_.close();
}

}  // namespace ferrobench::recordings
