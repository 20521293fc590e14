// Which of the commands that arrive from outside get into the controller's rings. Anybody may send, as fast as he can: what is dropped
// then must be neither a Stop nor the armed host's.
#pragma once

#include "common/core/capacities.hpp"
#include "firmware/controller/controller.hpp"

namespace trocar::controller {

// The upper half of the ring is for the armed host, whose keep-alives must not drown in what others send, and for Hold, which is open to
// all. At four a tick the lower half delays them by 8 ticks at most.
inline constexpr std::size_t room_for_all = capacity::command_ring / 2;

// False: there is no room for it. `session` is the armed host's, 0 for none.
inline bool let_in(Mailboxes& mail, std::uint64_t session, const Command& command) noexcept {
  // Full, its ring holds eight others that the next tick takes: this one has nothing to add.
  if (command.kind == CommandKind::Stop) return mail.stops.push(command);
  const bool first = command.kind == CommandKind::Hold || (command.session != 0 && command.session == session);
  if (!first && mail.commands.size() >= room_for_all) return false;
  return mail.commands.push(command);
}

}  // namespace trocar::controller
