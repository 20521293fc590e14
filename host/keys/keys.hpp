// Keys of one rig on a network: a certificate authority of its own, and for each role a folder that TROCAR_KEYS names
// (common/wire/dds.hpp).
//   rig        publishes everything but commands, reads commands
//   host       publishes commands, reads everything
//   observer   reads everything: `trocar record` works, commands do not
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace trocar::keys {

struct Options {
  std::filesystem::path folder;    // made anew
  std::string interface;           // on which rig and host meet, such as eth1
  std::vector<std::string> peers;  // addresses of the other machines there
};

// Throws config::UserError: the folder exists or cannot be made, a name or address is none, openssl is missing or failed. Leaves nothing
// half-made.
void make(const Options& options);

}  // namespace trocar::keys
