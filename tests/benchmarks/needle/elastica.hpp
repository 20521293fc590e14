// The exact cantilever under a dead force across its tip, by elliptic integrals. With theta' = sqrt(2 P / EI (sin a - sin theta)), a the
// tip's angle, p^2 = (1 + sin a) / 2 and sin(phi_0) = 1 / (p sqrt 2):
//   L sqrt(P / EI) = K(p) - F(phi_0, p)                        which determines a
//   y / L = 1 - 2 (E(p) - E(phi_0, p)) / (L sqrt(P / EI)),     x / L = sqrt(2 sin a) / (L sqrt(P / EI))
// Bisshopp and Drucker 1945, Quarterly of Applied Mathematics 3, 272.
#pragma once

namespace trocar::bench {

struct ElasticaTip {
  double x{}, y{};  // over the length
  double theta_rad{};
};

// load = P L^2 / EI > 0.
[[nodiscard]] ElasticaTip elastica(double load);

}  // namespace trocar::bench
