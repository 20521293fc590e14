// A block of two layers, 40 x 20 x 20 mm: the source of the .msh files beside it.
Point(1) = {0, 0, 0, 0.02};
Point(2) = {0.04, 0, 0, 0.02};
Point(3) = {0.04, 0.02, 0, 0.02};
Point(4) = {0, 0.02, 0, 0.02};
Line(1) = {1, 2};
Line(2) = {2, 3};
Line(3) = {3, 4};
Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4};
Plane Surface(1) = {1};
Transfinite Curve{1, 3} = 4;
Transfinite Curve{2, 4} = 3;
Transfinite Surface{1};
