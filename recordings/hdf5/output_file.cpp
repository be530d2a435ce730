#include "recordings/hdf5/output_file.h"

#include "recordings/format/version.h"

namespace ferrobench::recordings {
namespace {

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

}  // namespace

OutputFile::OutputFile(const NewFile& file, const Begin& begin, std::uint64_t rows)
    : rows_(rows), raw_width_(begin.raw.size()), target_(file), out_(target_.create(), file.path()) {
  write_header(begin.header);
  make_columns(begin.header, begin.channels);
  out_.group("/entry/events", "NXcollection");
  if (!begin.others.empty()) make_others(begin.others);
  if (!begin.raw.empty()) make_raw(begin.raw);
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
  if (header.past.known()) write_past(header.past);
  out_.group("/entry/load", "NXcollection");
  out_.number("/entry/load/spring_stiffness_N_per_m", header.load.spring_stiffness, "N/m");
  out_.number("/entry/load/prestress_Pa", header.load.prestress, "Pa");
  out_.group("/entry/instrument", "NXinstrument");
  json("/entry/instrument/device", header.device);
}

void OutputFile::write_past(const protocols::Past& past) {
  const std::string group = "/entry/sample/past";
  out_.group(group, "NXcollection");
  out_.text(group + "/kind", write_json(past.kind).get<std::string>());
  if (past.from) out_.text(group + "/from", write_json(*past.from).get<std::string>());
  if (past.poling) out_.number(group + "/poling", *past.poling, "1");
  if (past.kind != protocols::PastKind::visited) return;
  std::vector<double> fields, seconds;
  for (const auto& level : past.levels) {
    fields.push_back(level.field);
    seconds.push_back(level.seconds);
  }
  out_.numbers(group + "/field", fields, "V/m");
  out_.numbers(group + "/seconds", seconds, "s");
}

hdf5::Handle OutputFile::make_column(const std::string& place, hid_t type, std::size_t width) {
  const int rank = width == 0 ? 1 : 2;
  const std::array<hsize_t, 2> size{rows_, width};
  const std::array<hsize_t, 2> chunk{std::clamp<hsize_t>(rows_, 1, chunk_rows), width};
  auto properties = hdf5::properties(H5Pcreate(H5P_DATASET_CREATE));
  H5Pset_obj_track_times(properties.get(), false);
  H5Pset_chunk(properties.get(), rank, chunk.data());
  H5Pset_shuffle(properties.get());
  H5Pset_deflate(properties.get(), 2);
  H5Pset_fletcher32(properties.get());
  const auto space = hdf5::space(H5Screate_simple(rank, size.data(), size.data()));
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

// A plot of its own, over the same time.
void OutputFile::make_others(std::span<const ColumnName> others) {
  const std::string group = "/entry/others";
  out_.group(group, "NXdata");
  std::vector<std::string> names;
  for (const auto& column : others) {
    const auto& [place, made] = others_.emplace_back(
        other_place(column.name), make_column(other_place(column.name), H5T_NATIVE_DOUBLE, 0));
    if (!column.unit.empty()) out_.attribute(place, "units", column.unit);
    out_.attribute(place, "long_name", column.long_name);
    names.push_back(column.name);
  }
  out_.attribute(group, "columns", std::span<const std::string>(names));
  out_.attribute(group, "signal", names.front());
  out_.attribute(group, "axes", std::string("time"));
  out_.need(H5Lcreate_hard(out_.id(), "/entry/data/time", out_.id(), (group + "/time").c_str(), H5P_DEFAULT,
                           H5P_DEFAULT) >= 0,
            group + "/time");
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
    const auto in_file = hdf5::space(H5Dget_space(column.get()));
    const std::array<hsize_t, 2> start{first, 0};
    const std::array<hsize_t, 2> size{count, width};
    const auto in_memory = hdf5::space(H5Screate_simple(width == 0 ? 1 : 2, size.data(), nullptr));
    out_.need(H5Sselect_hyperslab(in_file.get(), H5S_SELECT_SET, start.data(), nullptr, size.data(),
                                  nullptr) >= 0 &&
                  H5Dwrite(column.get(), type, in_memory.get(), in_file.get(), H5P_DEFAULT, data) >= 0,
              place);
  };
  put(time_, H5T_NATIVE_DOUBLE, 0, rows.time.data(), "/entry/data/time");
  for (const auto channel : all_channels) {
    const auto i = static_cast<std::size_t>(channel);
    if (columns_.at(i))
      put(columns_.at(i), H5T_NATIVE_DOUBLE, 0, rows.channels.at(i).data(), channel_place(channel));
  }
  for (std::size_t i = 0; i < others_.size(); ++i)
    put(others_[i].second, H5T_NATIVE_DOUBLE, 0, rows.others.at(i).data(), others_[i].first);
  if (counts_) put(counts_, H5T_NATIVE_INT16, raw_width_, rows.counts.data(), "/entry/instrument/raw/ai");
  target_.check();
}

void OutputFile::write_closing(const Closing& closing) {
  out_.text("/entry/end_time", closing.end_time);
  out_.text("/entry/status", closing.status);
  if (!closing.reason.empty()) out_.fixed_attribute("/entry/status", "reason", closing.reason);

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
  for (auto& [place, column] : others_) column.close();
  counts_.close();
  out_.close();
  target_.check();
}

}  // namespace ferrobench::recordings
