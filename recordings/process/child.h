// Child processes for what strangers' files may crash or hold up: they inherit no descriptor, end with this
// process and with all that they start, and are the first to go when memory is short.
#pragma once

#include <sys/resource.h>
#include <sys/types.h>

#include <span>
#include <string>

namespace ferrobench::recordings {

// This program once more, in a group of its own, so that Ctrl-C is its parent's affair. It does its work
// before main(), in a [[gnu::constructor]] that knows arguments[0]. Its standard input and output are the
// descriptors given (above 2; -1: /dev/null), and it has no others.
class Child {
 public:
  // Throws std::system_error: none could be started, or this program is about to end.
  explicit Child(std::span<const std::string> arguments, int input = -1, int output = -1);
  ~Child() { end(); }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  bool over() const;
  // Kills what is left of it and of its group. The status that it ended with before stays as it is.
  int end();

 private:
  pid_t child_ = 0;
};

// This program once more, as a process that lives on when this one ends: in a session of its own, with
// `socket` (above 2) as its standard input and this program's standard error; it has no other descriptor.
// `priority`: of SCHED_RR, which it has from its first instruction on where the system allows it. Throws
// std::system_error.
pid_t start_apart(const std::string& name, int socket, int priority);

// In the child, first of all. It ends when the thread that started it does.
void be_a_child();
// A limit that it sets itself, as for setrlimit(2).
void allow(int resource, rlim_t most);

// The program is about to end: children under way are killed, and none is started any more.
void end_all_children();
bool children_are_ended();

}  // namespace ferrobench::recordings
