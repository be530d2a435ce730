#include <sstream>

#include "server/packaging/documents.h"

namespace ferrobench::packaging {
namespace {

// Nothing of the text is taken for a request or an escape of roff, and a minus stays one that can be copied.
std::string plain(const std::string& text) {
  std::string out;
  bool at_line_begin = true;
  for (const char c : text) {
    if (at_line_begin && (c == '.' || c == '\'')) out += "\\&";
    if (c == '\\')
      out += "\\e";
    else if (c == '-')
      out += "\\-";
    else
      out += c;
    at_line_begin = c == '\n';
  }
  return out;
}

void paragraph(std::ostream& page, const std::string& text) {
  if (!text.empty()) page << ".PP\n.nf\n" << plain(text) << "\n.fi\n";
}

// The first line is the sentence, what follows keeps its lines, as examples do.
void describe(std::ostream& page, const std::string& text) {
  const auto end = text.find('\n');
  page << ".PP\n" << plain(text.substr(0, end)) << '\n';
  if (end != std::string::npos) paragraph(page, text.substr(end + 1));
}

void options(std::ostream& page, const CLI::App& command) {
  for (const auto* option : command.get_options()) {
    if (option->get_group().empty()) continue;  // hidden
    page << ".TP\n.B " << plain(option->get_name(option->get_positional(), true));
    if (option->get_type_size() != 0) page << " \\fI" << plain(option->get_type_name()) << "\\fR";
    page << '\n' << plain(option->get_description());
    if (!option->get_default_str().empty()) page << " (default: " << plain(option->get_default_str()) << ')';
    if (!option->get_envname().empty()) page << " [" << plain(option->get_envname()) << ']';
    if (option->get_required()) page << " (required)";
    page << '\n';
  }
}

void commands(std::ostream& page, const CLI::App& parent, const std::string& before) {
  for (const auto* command : parent.get_subcommands({})) {
    if (command->get_group().empty()) continue;  // hidden
    const auto name = before + " " + command->get_name();
    std::string line = name;
    for (const auto* option : command->get_options())
      if (option->get_positional()) line += " " + option->get_name(true);
    page << ".SS " << plain(line) << '\n';
    describe(page, command->get_description());
    options(page, *command);
    paragraph(page, command->get_footer());
    commands(page, *command, name);
  }
}

}  // namespace

std::string manual_page(const CLI::App& program, const std::string& version) {
  std::ostringstream page;
  page << R"(.TH FERROBENCH 1 "" "ferrobench )" << plain(version) << "\" \"User Commands\"\n"
       << ".SH NAME\nferrobench \\- bench for ferroelectric actuators\n"
       << ".SH SYNOPSIS\n.B ferrobench\n[\\fIoptions\\fR] \\fIcommand\\fR [\\fIarguments\\fR]\n"
       << ".SH DESCRIPTION\n";
  describe(page, program.get_description());
  paragraph(page, program.get_footer());
  page << ".SH OPTIONS\n";
  options(page, program);
  page << ".SH COMMANDS\n";
  commands(page, program, "ferrobench");
  return page.str();
}

}  // namespace ferrobench::packaging
