#include <sstream>

#include "model/model.h"
#include "protocols/protocol.h"
#include "server/packaging/documents.h"

namespace ferrobench::packaging {
namespace {

std::string joined(const std::vector<std::string>& words) {
  std::string out;
  for (const auto& word : words) out += (out.empty() ? "" : " ") + word;
  return out;
}

std::vector<std::string> dashed(const CLI::Option& option) {
  std::vector<std::string> out;
  for (const auto& name : option.get_snames()) out.push_back("-" + name);
  for (const auto& name : option.get_lnames()) out.push_back("--" + name);
  return out;
}

// What may stand for an option or a positional argument, where that can be listed.
std::vector<std::string> values(const CLI::Option& option) {
  if (option.get_name(true) == "PROTOCOL") return protocols::library_names();
  if (option.get_name(true) == "MODEL" || option.check_lname("model")) return model::model_library_names();
  // What one_of() allows is seen in the option's type alone: "TEXT:{text,json}".
  const auto type = option.get_type_name();
  const auto begin = type.find('{');
  const auto end = type.find('}');
  if (begin == std::string::npos || end == std::string::npos) return {};
  return CLI::detail::split(type.substr(begin + 1, end - begin - 1), ',');
}

struct Cases {
  std::ostringstream path, words, values;
};

void collect(const CLI::App& command, const std::string& path, std::vector<std::string> inherited,
             Cases& cases) {
  std::vector<std::string> words;
  for (const auto* option : command.get_options()) {
    if (option->get_group().empty()) continue;  // hidden
    const auto allowed = values(*option);
    const auto names = dashed(*option);
    words.insert(words.end(), names.begin(), names.end());
    if (option->get_positional()) words.insert(words.end(), allowed.begin(), allowed.end());
    if (option->get_type_size() == 0) continue;  // a flag
    for (const auto& name : names)
      // The program's own options go with every command.
      cases.values << "    " << (path.empty() ? "*" : "") << '"' << path << ' ' << name << "\") words=\""
                   << joined(allowed) << "\" ;;\n";
  }
  if (path.empty()) inherited = words;
  for (const auto* sub : command.get_subcommands({})) {
    if (sub->get_group().empty()) continue;  // hidden
    const auto name = sub->get_name();
    auto below = path;
    below.append(" ").append(name);
    words.push_back(name);
    cases.path << "      \"" << path << '|' << name << "\") path=\"" << below << "\" ;;\n";
    collect(*sub, below, inherited, cases);
  }
  if (!path.empty()) words.insert(words.end(), inherited.begin(), inherited.end());
  cases.words << "    \"" << path << "\") words=\"" << joined(words) << "\" ;;\n";
}

}  // namespace

std::string bash_completion(const CLI::App& program) {
  Cases cases;
  collect(program, "", {}, cases);
  std::ostringstream out;
  out << "# Completion of ferrobench for bash: commands, options and what they allow; else files.\n"
         "_ferrobench() {\n"
         "  local path= words= i\n"
         "  for ((i = 1; i < COMP_CWORD; ++i)); do\n"
         "    case \"$path|${COMP_WORDS[i]}\" in\n"
      << cases.path.str()
      << "    esac\n"
         "  done\n"
         "  case \"$path\" in\n"
      << cases.words.str()
      << "  esac\n"
         "  case \"$path ${COMP_WORDS[COMP_CWORD - 1]}\" in\n"
      << cases.values.str()
      << "  esac\n"
         "  COMPREPLY=($(compgen -W \"$words\" -- \"${COMP_WORDS[COMP_CWORD]}\"))\n"
         "}\n"
         "complete -o default -F _ferrobench ferrobench\n";
  return out.str();
}

}  // namespace ferrobench::packaging
