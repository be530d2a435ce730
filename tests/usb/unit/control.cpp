// The unit's answers to control requests (protocol note 2). A write whose data do not fit, a read of what can
// only be written, and an unknown number stall.
#include "unit/bytes.h"
#include "unit/requests.h"
#include "unit/unit.h"

namespace ferrobench::emulator {

namespace {

constexpr std::uint8_t direction_in = 0x80, type_mask = 0x60;

std::vector<std::byte> byte_of(unsigned value) {
  return {static_cast<std::byte>(value & 0xFFU)};
}

std::vector<std::byte> word_of(unsigned value) {
  std::vector<std::byte> out;
  append16(out, static_cast<std::uint16_t>(value));
  return out;
}

}  // namespace

std::optional<std::vector<std::byte>> Unit::control(const Request& request, std::span<const std::byte> data) {
  if ((request.type & type_mask) == 0) return standard(request);
  if (request.type == emulator::vendor_out) return vendor_out(request, data);
  if (request.type != emulator::vendor_in) return std::nullopt;
  if (stalls_by_fault(request.number)) return std::nullopt;
  auto answer = vendor_in(request);
  if (!answer) return answer;
  if (answer->size() > request.length) answer->resize(request.length);
  if (faults_.cut_answer && faults_.cut_answer->request == request.number && --faults_.cut_answer->nth == 0) {
    answer->resize(std::min(answer->size(), faults_.cut_answer->length));
    faults_.cut_answer.reset();
  }
  return answer;
}

bool Unit::stalls_by_fault(std::uint8_t number) {
  if (!faults_.stall || faults_.stall->request != number || --faults_.stall->nth > 0) return false;
  faults_.stall.reset();
  return true;
}

bool Unit::works_without_fpga(std::uint8_t number) const {
  switch (number) {
    case request::memory:
    case request::memory_address:
    case request::status:
    case request::blink:
    case request::reset:
    case request::serial:
    case request::fpga_configure:
    case request::fpga_data:
      return true;
    default:
      return fpga_.configured();
  }
}

Unit::Answer Unit::standard(const Request& request) {
  if ((request.type & direction_in) != 0) {
    auto answer = standard_in(setup_, request);
    if (answer && answer->size() > request.length) answer->resize(request.length);
    return answer;
  }
  constexpr std::uint8_t clear_feature = 0x01, set_configuration = 0x09, set_interface = 0x0B;
  const std::vector<std::byte> done;
  switch (request.number) {
    case clear_feature:
      if (request.index == input_endpoint)
        input_.clear_halt();
      else if (request.index == output_endpoint)
        output_.clear_halt();
      else
        return std::nullopt;
      return done;
    case set_configuration:
      if (request.value > 1) return std::nullopt;
      return done;
    case set_interface:
      if (request.value != 0) return std::nullopt;
      return done;
    default:
      return std::nullopt;
  }
}

Unit::Answer Unit::vendor_in(const Request& r) {
  if (!works_without_fpga(r.number)) return std::nullopt;
  std::vector<std::byte> out;
  switch (r.number) {
    case request::tristate:
      return word_of(inputs_);
    case request::pins:
      return word_of(pins());
    case request::latch:
      return word_of(latch_);
    case request::input_value: {
      std::uint16_t code = 0;
      if (!input_.convert_once(r.value, now_, code)) return std::nullopt;
      return word_of(code);
    }
    case request::queue:
      if (input_.on()) return std::nullopt;
      return std::vector(input_.queue().begin(), input_.queue().end());
    case request::output_value:
      if (!has_outputs()) return std::nullopt;
      for (const std::uint16_t code : codes_) append16(out, code);
      return out;
    case request::counter:
      for (const std::uint32_t count : counters_) append32(out, count);
      return out;
    case request::timer_control:
      if (r.index != 0) return std::nullopt;
      return byte_of(timer_.control());
    case request::timer_parameters: {
      if (r.index != 0) return std::nullopt;
      const auto& p = timer_.parameters();
      for (const std::uint32_t v : {p.period, p.width, p.count, p.delay}) append32(out, v);
      return out;
    }
    case request::memory:
      if (!eeprom_.read(r.length, out)) return std::nullopt;
      return out;
    case request::memory_address:
      return word_of(eeprom_.address());
    case request::status:
      return word_of(status());
    case request::trigger:
      return byte_of(trigger_mode_);
    case request::temperature:
      return word_of(static_cast<std::uint16_t>(static_cast<std::int16_t>(setup_.temperature * 256)));
    case request::serial:
      for (const char c : setup_.serial) out.push_back(static_cast<std::byte>(c));
      return out;
    case request::fpga_version:
      return word_of(setup_.fpga_version);
    default:
      return std::nullopt;
  }
}

Unit::Answer Unit::vendor_out(const Request& r, Data data) {
  if (stalls_by_fault(r.number) || !works_without_fpga(r.number)) return std::nullopt;
  const std::vector<std::byte> done;
  const auto answer = [&](bool good) { return good ? Answer(done) : std::nullopt; };
  switch (r.number) {
    case request::tristate:
    case request::latch:
      return answer(data.empty() && write_digital(r));
    case request::input_start:
    case request::input_stop:
    case request::queue:
    case request::input_clear:
    case request::calibration_source:
      return answer(write_input(r, data));
    case request::output_value:
    case request::output_start:
    case request::output_stop:
    case request::output_clear:
      return answer(has_outputs() && write_output(r, data));
    case request::timer_control:
    case request::timer_parameters:
      return answer(r.index == 0 && write_timer(r, data));
    case request::counter:
      if (!data.empty() || r.value >= counters_.size()) return std::nullopt;
      counters_.at(r.value) = 0;
      return done;
    default:
      return answer(write_system(r, data));
  }
}

bool Unit::write_digital(const Request& r) {
  (r.number == request::tristate ? inputs_ : latch_) = static_cast<std::uint8_t>(r.value & 0xFFU);
  digital_changed();
  return true;
}

bool Unit::write_input(const Request& r, Data data) {
  switch (r.number) {
    case request::queue:
      return input_.set_queue(data);
    case request::calibration_source:
      return data.size() == 1 && input_.set_source(std::to_integer<unsigned>(data[0]));
    case request::input_start:
      if (!input_.start(data, now_)) return false;
      fire_if_level();
      return true;
    case request::input_stop:
      if (!data.empty()) return false;
      if (input_.hung()) faults_.hang.reset();
      input_.stop();
      return true;
    default:
      if (!data.empty()) return false;
      input_.clear();
      return true;
  }
}

bool Unit::write_output(const Request& r, Data data) {
  switch (r.number) {
    case request::output_start:
      if (!output_.start(data, now_)) return false;
      fire_if_level();
      return true;
    case request::output_value:
      if (!data.empty() || r.index >= codes_.size() || output_.on()) return false;
      set_output(r.index, r.value);
      return true;
    case request::output_stop:
      if (!data.empty()) return false;
      output_.stop();
      return true;
    default:
      if (!data.empty()) return false;
      output_.clear();
      return true;
  }
}

bool Unit::write_timer(const Request& r, Data data) {
  if (r.number == request::timer_parameters) {
    if (data.size() != 16) return false;
    timer_.set_parameters({.period = get32(data),
                           .width = get32(data.subspan(4)),
                           .count = get32(data.subspan(8)),
                           .delay = get32(data.subspan(12))});
    return true;
  }
  if (!data.empty()) return false;
  const bool before = timer_.level();
  timer_.set_control(static_cast<std::uint8_t>(r.value & 0xFFU), now_);
  timer_changed(before);
  return true;
}

bool Unit::write_system(const Request& r, Data data) {
  const auto one = [&] { return data.size() == 1; };
  switch (r.number) {
    case request::memory:
      return eeprom_.write(data);
    case request::memory_address:
      if (data.size() != 2) return false;
      eeprom_.set_address(get16(data));
      return true;
    case request::blink:
      if (!one()) return false;
      blinks_ += std::to_integer<unsigned>(data[0]);
      return true;
    case request::reset:
      if (!data.empty()) return false;
      reset();
      lose_bus();
      return true;
    case request::trigger:
      if (!one()) return false;
      trigger_mode_ = std::to_integer<std::uint8_t>(data[0]) & 3U;
      fire_if_level();
      return true;
    case request::fpga_configure:
      if (!one() || std::to_integer<std::uint8_t>(data[0]) != fpga_key) return false;
      input_.power_up();
      output_.power_up();
      fpga_.begin();
      return true;
    case request::fpga_data: {
      const bool taken = fpga_.take(data.size(), faults_.fpga_refuses);
      if (taken && !fpga_.configuring()) faults_.fpga_refuses = false;
      if (taken && fpga_.configured()) input_.unsettle();
      return taken;
    }
    default:
      return false;
  }
}

}  // namespace ferrobench::emulator
