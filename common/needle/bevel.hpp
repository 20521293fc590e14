// The lateral force that a bevelled tip takes from cutting.
//
//   One plane face at angle beta to the shaft (30 degrees is common, 90 is cut square). Tissue presses on the face along its normal and
//   drags along it with friction mu as the needle advances. Resolved along the shaft and across it, per unit of pressure,
//     axial  sin beta + mu cos beta,    lateral  cos beta - mu sin beta,    lateral / axial = cot(beta + atan mu)
//   This is the plane cutting wedge (Merchant 1945, J. Appl. Phys. 16, 267); bevelled needles are described so by Misra et al. 2010 (Int.
//   J. Robotics Research 29, 1640). It takes all of the cutting force to act on the face; what the edge takes itself pushes straight back,
//   so the ratio is an upper bound, and mu the number to fit. A symmetric tip has opposite faces, whose lateral forces cancel.
#pragma once

namespace trocar::needle {

struct Bevel {
  // 0: symmetric. Otherwise the angle between face and shaft, up to pi/2 either way. Positive: the point of the needle is on its left, the
  // face looks to the right, and the tissue pushes the tip to the left: along n = (-t_y, t_x), t from base to tip. Negative: mirrored.
  double angle_rad{};
  double friction{};  // of tissue on the face, mu >= 0
};

// Lateral force of the tissue on the tip along n, over the force that cuts along t (positive: advancing). It is not less than 0 times the
// sign of the angle: a face steeper than friction lets slide holds the tissue.
[[nodiscard]] double lateral_per_axial(const Bevel& bevel) noexcept;

}  // namespace trocar::needle
