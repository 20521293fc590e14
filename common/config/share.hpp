// The rigs, scenes and experiments that come with the programs.
#pragma once

#include <filesystem>
#include <string_view>

namespace trocar::config {

// `kind` is the folder: "rigs", "scenes", "experiments". A path (it holds '/' or ends in .toml) is returned as it is; a name such as
// "ubc_twin" is looked up as ../share/trocar/<kind>/<name>.toml from the folder of the running program.
// UserError with the place looked in, and the names that are there, when there is no such file.
[[nodiscard]] std::filesystem::path find_share(std::string_view kind, std::string_view name_or_path);

// The folder that holds those kinds.
[[nodiscard]] std::filesystem::path share_folder();

}  // namespace trocar::config
