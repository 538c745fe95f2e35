function [A, B, C, D, E, dx0, x0, u0, y0, delays] = symheli_at(family, airspeed)
%SYMHELI_AT  Data function for lpvss: matrices and trim offsets of a family (see load_symheli) at an
%   airspeed in m/s.
%   dx/dt = dx0 + A (x - x0) + B (u - u0),  y = y0 + C (x - x0) + D (u - u0)
    p = min(max(airspeed, family.airspeeds(1)), family.airspeeds(end));
    at = @(values) interpolate(family.airspeeds(:), values, p);
    A = at(family.A);
    B = at(family.B);
    C = at(family.C);
    D = at(family.D);
    x0 = at(reshape(family.x0, size(family.x0, 1), 1, []));
    u0 = at(reshape(family.u0, size(family.u0, 1), 1, []));
    y0 = at(reshape(family.y0, size(family.y0, 1), 1, []));
    dx0 = zeros(size(x0));
    E = [];
    delays = [];
end

function M = interpolate(airspeeds, values, p)
% straight between the pages of values (n, m, K)
    n = size(values, 1);
    m = size(values, 2);
    M = reshape(interp1(airspeeds, reshape(values, n * m, []).', p), n, m);
end
