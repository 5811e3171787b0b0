"""The operators in plain torch, one function each, as one would write them without this library.

Tests compare the operators with these functions, and benchmarks time both. Each function has the arguments of
``torch.ops.splitnerf.NAME``, in float32 or float64, and returns its results, except those that only the backward pass reads.
"""

import math

import torch
from torch import Tensor
from torch.nn import functional as F

PRIMES = (1, 2654435761, 805459861)  # Teschner et al. 2003
NEIGHBOURS = 16  # vertices that a point's visibility is averaged over
BITS = 32  # bits in a word
BLACK_LIGHT = 1e-4  # added to the light, so that its share is defined in the dark too

# ---- distance field ----


def hash_encode(
    positions: Tensor, table: Tensor, n_levels: int, base: int, growth: float, log2_size: int, n_active: int
) -> Tensor:
    """Trilinear interpolation at all levels and corners with a single gather, so that one gradient has the table's
    size."""
    levels = torch.arange(n_active)
    resolution = torch.floor(base * torch.tensor(growth, dtype=torch.float64) ** levels + 1e-6).long()
    nodes = resolution + 1
    dense = nodes**3 <= 2**log2_size
    size = torch.where(dense, nodes**3, 2**log2_size)
    scaled = positions.clamp(0, 1)[:, None, :] * resolution[:, None]
    cell = torch.minimum(scaled.detach().floor().long(), resolution[:, None] - 1)
    corners = torch.tensor([[c & 1, c >> 1 & 1, c >> 2] for c in range(8)])
    share = (scaled - cell)[:, :, None, :]
    weight = torch.where(corners.bool(), share, 1 - share).prod(-1, keepdim=True)  # [n, levels, 8, 1]
    i, j, k = (cell[:, :, None, :] + corners).unbind(-1)
    side = nodes[:, None]
    row_major, hashed = (i * side + j) * side + k, (i * PRIMES[0] ^ j * PRIMES[1] ^ k * PRIMES[2]) % 2**log2_size
    index = (size.cumsum(0) - size)[:, None] + torch.where(dense[:, None], row_major, hashed)
    features = (weight * F.embedding(index, table)).sum(2).flatten(1)
    return F.pad(features, (0, (n_levels - n_active) * table.shape[1]))


def layer_outputs(
    positions: Tensor, features: Tensor, hidden: Tensor, hidden_bias: Tensor, out: Tensor, out_bias: Tensor, beta: float
) -> Tensor:
    """One layer of softplus units over positions and features; torch's threshold of 20 changes a slope by e^-20."""
    units = F.softplus(F.linear(torch.cat([positions, features], 1), hidden, hidden_bias), beta, threshold=50)
    return F.linear(units, out, out_bias)


def sdf_field(
    positions, table, hidden, hidden_length, hidden_bias, out, out_length, out_bias, beta, *grid_and_box
) -> tuple[Tensor, Tensor, Tensor]:
    """Outputs, features, and the gradient of the first output by differentiation, which is itself differentiated."""
    *grid, box = grid_and_box
    hidden, out = (
        d * (length / d.norm(dim=1, keepdim=True)) for d, length in ((hidden, hidden_length), (out, out_length))
    )
    with torch.enable_grad():
        x = positions.detach().requires_grad_()
        features = hash_encode(x / (2 * box) + 0.5, table, *grid)
        outputs = layer_outputs(x, features, hidden, hidden_bias, out, out_bias, beta)
        (gradient,) = torch.autograd.grad(outputs[:, 0].sum(), x, create_graph=True)
    return outputs, features, gradient


# ---- rays ----


def ray_indices(offsets: Tensor) -> Tensor:
    """The ray of each sample."""
    return torch.repeat_interleave(torch.arange(len(offsets) - 1), offsets.diff())


def neus_weights(f_prev, f_next, s, offsets, min_transmittance) -> tuple[Tensor, Tensor]:
    """w = alpha T and its sum, with alpha = (Phi(s f_prev) - Phi(s f_next))+ / Phi(s f_prev) as one minus a ratio of
    sigmoids; w is 0 where the transmittance is below the least."""
    passing = (F.logsigmoid(s * f_next) - F.logsigmoid(s * f_prev)).clamp(max=0)  # log(1 - alpha)
    rays = ray_indices(offsets)
    counts = offsets.diff()
    padded = passing.new_zeros(len(counts), int(counts.max()) if len(counts) else 0)
    places = rays, torch.arange(len(rays)) - offsets[rays]
    padded = padded.index_put(places, passing)
    before = (padded.cumsum(1) - padded)[places]
    weights = torch.where(before.detach().exp() >= min_transmittance, before.exp() * -torch.expm1(passing), 0)
    return weights, torch.zeros(len(counts), dtype=weights.dtype).index_add(0, rays, weights)


def surface_weights(
    sdf, gradient, rays_d, s, offsets, step, anneal, min_transmittance, n_samples=-1
) -> tuple[Tensor, Tensor, Tensor]:
    """Unit normals, weights and their sum: the interval of a sample by its slope along the ray, annealed."""
    n = len(sdf) if n_samples < 0 else n_samples
    sdf, gradient = (sdf[:, 0] if sdf.dim() == 2 else sdf)[:n], gradient[:n]
    squared = (gradient * gradient).sum(1, keepdim=True)
    gradient = torch.where(squared < 1e-6, gradient.detach(), gradient)
    normals = gradient * torch.rsqrt((gradient * gradient).sum(1, keepdim=True) + 1e-12)
    cosine = (rays_d[ray_indices(offsets)] * normals).sum(1)
    half = 0.5 * step * -(torch.relu(0.5 - 0.5 * cosine) * (1 - anneal) + torch.relu(-cosine) * anneal)
    return normals, *neus_weights(sdf - half, sdf + half, s, offsets, min_transmittance)


def composite(
    weights: Tensor, values: Tensor, offsets: Tensor, opacity: Tensor | None = None, least: float = 1.0
) -> Tensor:
    """sum w v along each ray, over its opacity if that is given."""
    sums = torch.zeros(len(offsets) - 1, values.shape[1], dtype=values.dtype)
    sums = sums.index_add(0, ray_indices(offsets), weights[:, None] * values)
    return sums if opacity is None else sums / opacity.clamp(min=least)[:, None]


def interpolate(values: Tensor, first: Tensor, second: Tensor, share: Tensor) -> Tensor:
    return torch.lerp(values[first], values[second], share[:, None])


# ---- shading ----


def brdf_table(lut: Tensor, n_dot_v: Tensor, roughness: Tensor) -> Tensor:
    """[n, 4] F1, F2, chi, E_d: bilinear in roughness and sqrt(n.v), [n, 1] both."""
    lut, n = lut.to(roughness.dtype), len(lut) - 1
    x, y = n_dot_v.clamp(1e-4, 1).sqrt() * n, roughness.clamp(0, 1) * n
    x0, y0 = x.detach().long().clamp(max=n - 1), y.detach().long().clamp(max=n - 1)
    fx, fy = x - x0, y - y0
    x0, y0 = x0[:, 0], y0[:, 0]
    top, bottom = (torch.lerp(lut[row, x0], lut[row, x0 + 1], fx) for row in (y0, y0 + 1))
    return torch.lerp(top, bottom, fy)


def facing(normals: Tensor, view_dirs: Tensor) -> tuple[Tensor, Tensor]:
    """Normals turned towards the viewer, and their cosine."""
    cosine = (normals * view_dirs).sum(1, keepdim=True)
    return torch.where(cosine < 0, -normals, normals), cosine.abs()


def light_queries(normals, view_dirs, roughness, lut, mean) -> tuple[Tensor, Tensor]:
    """The mirrored view, or the mean direction of the lobe around it, with the roughness; then the normal with 1."""
    normals, cosine = facing(normals, view_dirs)
    lobes = 2 * cosine * normals - view_dirs
    if mean:
        lobes = mean_direction(normals, cosine, lobes, roughness, lut)
    return torch.cat([lobes, normals]), torch.cat([roughness, torch.ones_like(roughness)])


def mean_direction(normals: Tensor, cosine: Tensor, mirror: Tensor, roughness: Tensor, lut: Tensor) -> Tensor:
    t = ((roughness - 0.3) / 0.1).clamp(0, 1)
    k = 1 + t * t * (3 - 2 * t) * (brdf_table(lut, cosine, roughness)[:, 2:3] - 1)
    return F.normalize((1 - k) * normals + k * mirror, dim=1)


def gain(f0: Tensor | float, f1: Tensor, f2: Tensor, compensate: bool) -> Tensor | float:
    """What multiple scattering makes of single scattering, a factor."""
    return 1 + f0 * (1 / (f1 + f2) - 1) if compensate else 1.0


def split_sum_shade(normals, view_dirs, albedo, roughness, metallic, specular, diffuse, *occlusion_and_rest) -> Tensor:
    """(1 - metallic) kept albedo (o_d L_d + I_d) + E (o_s L_s + I_s). Mode exact: E of metal and dielectric, mixed, and
    the dielectric's 1 - E; paper: E = F F1 + F2 and 1 - F. Without `diffuse`, `specular` holds both, L_s first."""
    occlusion_s, occlusion_d, lut, mode, compensate, *indirect = occlusion_and_rest
    indirect_s, indirect_d = indirect or (None, None)
    _, cosine = facing(normals, view_dirs)
    f1, f2, _, layer = brdf_table(lut, cosine, roughness).split(1, 1)
    if mode:
        f0 = 0.04 * (1 - metallic) + metallic * albedo
        fresnel = f0 + (1 - roughness - f0) * (1 - cosine) ** 5
        energy, kept = (fresnel * f1 + f2) * gain(fresnel, f1, f2, compensate), 1 - fresnel
    else:
        coat = layer * gain(0.04, f1, f2, compensate)
        metal = (albedo * f1 + f2) * gain(albedo, f1, f2, compensate)
        energy, kept = metallic * metal + (1 - metallic) * coat, 1 - coat
    light_s, light_d = specular.chunk(2) if diffuse is None else (specular, diffuse)
    arriving_s = occlusion_s * light_s + (0 if indirect_s is None else indirect_s)
    arriving_d = occlusion_d * light_d + (0 if indirect_d is None else indirect_d)
    return (1 - metallic) * kept * albedo * arriving_d + energy * arriving_s


def shade_sums(
    normals, view_dirs, albedo, roughness, metallic, sums, lut, compensate, other=None, share=None
) -> Tensor:
    """Radiance reflected from sums [n, 4, 3] over the light: of the lobe, with Schlick's factor (1 - v.h)^5, of the
    diffuse light, and with the exact Fresnel factor. With `other` its difference to that radiance, times `share`."""
    specular, grazing, diffuse, dielectric = sums.unbind(1)
    _, cosine = facing(normals, view_dirs)
    f1, f2, _, layer = brdf_table(lut, cosine, roughness).split(1, 1)
    coat = gain(0.04, f1, f2, compensate)
    metal = gain(albedo, f1, f2, compensate) * (albedo * (specular - grazing) + grazing)
    summed = metallic * metal + (1 - metallic) * (coat * dielectric + (1 - coat * layer) * albedo * diffuse)
    return summed if other is None else (summed - other) * share[:, None]


def fresnel_dielectric(cosine: Tensor) -> Tensor:
    """Reflectance of a dielectric of index 1.5: the mean over both polarisations."""
    cosine = cosine.clamp(0, 1)
    refracted = (1 - (1 - cosine**2) / 1.5**2).sqrt()
    across = (cosine - 1.5 * refracted) / (cosine + 1.5 * refracted)
    along = (1.5 * cosine - refracted) / (1.5 * cosine + refracted)
    return (across**2 + along**2) / 2


def monte_carlo_light(normals, view_dirs, roughness, light_dirs, pdf, radiance) -> Tensor:
    """[n, 4, 3] means over directions: D V (n.l) L / p, the same times (1 - v.h)^5, (n.l) L / (pi p), and the first
    times the Fresnel factor of a dielectric."""
    normals, n_v = facing(normals, view_dirs)
    n_v = n_v.clamp(min=1e-4)
    a2 = (roughness**2).clamp(min=2e-3) ** 2
    half = F.normalize(light_dirs + view_dirs[:, None], dim=-1)
    n_l = (light_dirs * normals[:, None]).sum(-1).clamp(min=0)
    v_h = (half * view_dirs[:, None]).sum(-1)
    apart = (normals[:, None] - half).square().sum(-1)
    d = a2 / (math.pi * (a2 + (1 - a2) * apart * (1 - apart / 4)) ** 2)
    smith = n_l * torch.sqrt(n_v**2 * (1 - a2) + a2) + n_v * torch.sqrt(n_l**2 * (1 - a2) + a2)
    lobe = 0.5 * d / smith * n_l
    parts = lobe, lobe * (1 - v_h).clamp(0, 1) ** 5, n_l / math.pi, lobe * fresnel_dielectric(v_h)
    weights = torch.stack(parts, 1)
    share = torch.where(pdf > 0, 1 / (light_dirs.shape[1] * pdf), 0)
    return weights @ (radiance * share[..., None])


def summed_light(normals, view_dirs, roughness, directions, solid_angles, radiance, visible, sent) -> Tensor:
    """The sums of :func:`monte_carlo_light` over shared directions, whose densities follow from their solid angles."""
    n, k = visible.shape
    incoming = visible[..., None] * radiance
    incoming = incoming + sent if len(sent) else incoming
    pdf = (1 / (k * solid_angles)).expand(n, k)
    return monte_carlo_light(normals, view_dirs, roughness, directions.expand(n, k, 3), pdf, incoming)


def linear_to_srgb(linear: Tensor) -> Tensor:
    power = 1.055 * linear.clamp(min=0.0031308) ** (1 / 2.4) - 0.055
    return torch.where(linear <= 0.0031308, 12.92 * linear.clamp(min=0), power)


def srgb_to_linear(srgb: Tensor) -> Tensor:
    power = ((srgb.clamp(min=0.04045) + 0.055) / 1.055) ** 2.4
    return torch.where(srgb <= 0.04045, srgb / 12.92, power)


# ---- light ----


def ggx_lobe(cosine: Tensor, a2: Tensor) -> Tensor:
    """D (w.w_s)+ from the cosine of w and w_s; D is taken at half the angle between them."""
    return a2 / (math.pi * ((1 + cosine) / 2 * (a2 - 1) + 1).square()) * cosine.clamp(min=0)


def prefilter_light(query_dirs: Tensor, roughness: Tensor, light_dirs: Tensor, light: Tensor) -> Tensor:
    """The light's mean under the lobe, with the whole matrix of weights in memory."""
    weight = ggx_lobe(query_dirs @ light_dirs.T, roughness.square().clamp(min=1e-4).square())
    return weight @ light / weight.sum(1, keepdim=True)


def sparse_product(offsets, columns, weights, places, images, *transposed_and_values) -> Tensor:
    """The product of a sparse matrix, given by rows, with a dense one: an image at a time, by torch."""
    *_, values = transposed_and_values
    half = torch.sparse_csr_tensor(offsets, columns.long(), weights, (len(places), len(values)))
    whole = [half @ values[image.long()] for image in images.T]
    return torch.cat(whole)[places.T.flatten().argsort()]


def octahedral_texels(w: Tensor, n: int) -> tuple[Tensor, Tensor]:
    """Indices [4, k] and weights [4, k] of the texels around directions; each edge continues at its own mirror
    image."""
    p = w / w.abs().sum(1, keepdim=True)
    sign = torch.where(p < 0, -1.0, 1.0).to(p.dtype)
    folded = (1 - p[:, :2].flip(1).abs()) * sign[:, :2]
    x = (torch.where(p[:, 2:] >= 0, p[:, :2], folded) + 1) * (n / 2) - 0.5
    x0 = x.detach().floor().clamp(-1, n - 1)
    f, x0 = x - x0, x0.long()
    indices, shares = [], []
    for k in range(4):
        i, j = x0[:, 0] + (k & 1), x0[:, 1] + (k >> 1)
        out = (i < 0) | (i >= n)
        j, i = torch.where(out, n - 1 - j, j), i.clamp(0, n - 1)
        out = (j < 0) | (j >= n)
        i, j = torch.where(out, n - 1 - i, i), j.clamp(0, n - 1)
        indices.append(j * n + i)
        shares.append((f[:, 0] if k & 1 else 1 - f[:, 0]) * (f[:, 1] if k >> 1 else 1 - f[:, 1]))
    return torch.stack(indices), torch.stack(shares)


def spherical_harmonics(w: Tensor, degree: int) -> Tensor:
    """[k, (degree + 1)^2] real spherical harmonics, by the recurrence in the degree for each order m."""
    x, y, z = w.unbind(1)
    rows: dict[tuple[int, int], Tensor] = {}
    cosine, sine = torch.ones_like(x), torch.zeros_like(x)
    diagonal = 0.5 / math.sqrt(math.pi)
    for m in range(degree + 1):
        if m:
            diagonal *= math.sqrt((2 * m + 1) / (2 * m)) * (math.sqrt(2) if m == 1 else 1)
        before, p = torch.zeros_like(z), torch.full_like(z, diagonal)
        for l in range(m, degree + 1):
            rows[l, m], rows[l, -m] = p * cosine, p * (sine if m else cosine)
            span = (l + 1 - m) * (l + 1 + m)
            a = math.sqrt((2 * l + 3) * (2 * l + 1) / span)
            b = math.sqrt((2 * l + 3) * (l - m) * (l + m) / ((2 * l - 1) * span)) if l > m else 0.0
            before, p = p, a * z * p - b * before
        cosine, sine = cosine * x - sine * y, sine * x + cosine * y
    return torch.stack([rows[l, m] for l in range(degree + 1) for m in range(-l, l + 1)], 1)


def light_lookup(directions, roughness, levels, sh, resolutions, nodes, zonal) -> Tensor:
    """Radiance from maps between the nodes of roughness, and from spherical harmonics above the last node."""
    nodes = nodes.to(roughness.dtype)
    maps, start = [], 0
    for n in resolutions.tolist():
        index, share = octahedral_texels(directions, n)
        maps.append((levels[start + index] * share[..., None]).sum(0))
        start += n * n
    degree = math.isqrt(len(sh)) - 1
    place = (roughness - nodes[-1]) * ((len(zonal) - 1) / (1 - nodes[-1]))
    row = place.detach().long().clamp(0, len(zonal) - 2)
    factors = torch.lerp(zonal[row[:, 0]], zonal[row[:, 0] + 1], (place - row).clamp(0, 1))
    bands = torch.repeat_interleave(torch.arange(degree + 1), torch.arange(1, 2 * degree + 2, 2))
    x = (spherical_harmonics(directions, degree) * factors[:, bands]) @ sh
    floor = (sh[0] * 1e-3 * 0.5 / math.sqrt(math.pi)).clamp(min=1e-20)  # smaller sums are bent to stay positive
    maps.append(torch.where(x < floor, floor * torch.exp((x / floor).clamp(max=1) - 1), x))
    stacked = torch.stack(maps)
    k = torch.searchsorted(nodes, roughness.detach(), right=True).clamp(1, len(nodes) - 1)
    share = ((roughness - nodes[k - 1]) / (nodes[k] - nodes[k - 1])).clamp(0, 1)
    rows = torch.arange(len(directions))
    return torch.lerp(stacked[k[:, 0] - 1, rows], stacked[k[:, 0], rows], share)


# ---- visibility cached at vertices ----


def neighbours(positions, normals, vertices, vertex_normals, radius: float, n_levels: int) -> tuple[Tensor, Tensor]:
    """The vertices [n, k] of the largest weights around points, and their shares. They face the same way and lie within
    the radius; if there are none, the radius is doubled, up to `n_levels` times."""
    distance, cosine = torch.cdist(positions, vertices), (normals @ vertex_normals.T).clamp(min=0)
    weight, left = torch.zeros_like(distance), torch.arange(len(positions))
    for level in range(n_levels):
        relative = distance[left] / (radius * 2**level)
        found = ((1 - relative).clamp(min=0) / (relative + 0.05)) ** 2 * cosine[left] ** 4
        weight[left] = torch.where(found > 1e-6, found, 0)
        left = left[(weight[left] == 0).all(1)]
    weight, near = weight.topk(min(NEIGHBOURS, len(vertices)), 1)
    return near, weight / weight.sum(1, keepdim=True).clamp(min=1e-9)


def cached_visibility(
    positions, normals, vertices, vertex_normals, starts, order, radius, bits, hits, radiance, directions
) -> tuple[Tensor, Tensor]:
    """Open shares [n, directions], and the mesh's light [n, directions, 3] from each direction."""
    near, weight = neighbours(positions, normals, vertices, vertex_normals, radius, len(starts))
    places = torch.arange(BITS, dtype=torch.int32)
    known = (bits[near][..., None] >> places & 1).flatten(-2).to(weight.dtype) * weight[..., None, None]
    opened, blocked = known.sum(1).unbind(1)  # from [n, k, 2, directions]
    total = opened + blocked
    above = normals @ directions.T > 0
    covered = ((blocked > 0) & above).any(1, keepdim=True)  # elsewhere all directions are open
    visible = torch.where(covered & (total > 0), opened / total.clamp(min=1e-9), 1)
    if not hits.shape[1]:  # the mesh's light is unknown
        return visible, visible.new_zeros(*visible.shape, 3)
    sent = (radiance[hits[near].clamp(min=0)] * known[:, :, 1, :, None]).sum(1)
    return visible, sent * (above / total.clamp(min=1e-9))[..., None]


def cached_occlusion(
    positions, normals, lobe_dirs, roughness, *cache_and_light
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Shares of the light and means of the mesh's light, under the cosine and under the lobe, [n, 3] each."""
    *cache, light = cache_and_light
    visible, sent = cached_visibility(positions, normals, *cache)
    directions = cache[-1]
    cosine = (normals @ directions.T).clamp(min=0)
    ggx_alpha = roughness.square().clamp(min=math.sqrt(2 / 3 / len(directions)))
    lobe = ggx_lobe(lobe_dirs @ directions.T, ggx_alpha.square()) * (cosine > 0)
    kernels, light = (cosine, lobe), light + BLACK_LIGHT
    shares = [((visible * k) @ light / (k @ light)).clamp(max=1) for k in kernels]
    means = [(sent * k[..., None]).sum(1) / k.sum(1, keepdim=True).clamp(min=1e-9) for k in kernels]
    return *shares, *means


# ---- losses ----


def pixel_losses(mean, opacity, target, background, whole, exposure, linear: bool) -> tuple[Tensor, Tensor]:
    """Squared error over a background, one-sided where the photo is clipped, and cross entropy of the mask."""
    o, a, w, mean = opacity[:, None], target[:, 3:], whole[:, None], mean * exposure

    def clipped(linear_or_not: Tensor) -> Tensor:
        colour = linear_to_srgb(linear_or_not) if linear else linear_or_not
        return torch.where(target[:, :3] >= 254 / 255, colour.clamp(max=1), colour)

    over = clipped(mean) * o + background * (1 - o)
    if linear:
        over = torch.where(w, clipped(mean * o + srgb_to_linear(background) * (1 - o)), over)
    error = over - torch.where(w, target[:, :3], target[:, :3] * a + background * (1 - a))
    mask = F.binary_cross_entropy(opacity.clamp(1e-3, 1 - 1e-3), target[:, 3], reduction="none")
    return error.square().mean(), torch.where(whole, 0.1 * mask, mask).mean()


def gradient_losses(gradients: Tensor, weights: Tensor, beside: Tensor) -> tuple[Tensor, Tensor]:
    """(|g| - 1)^2, and the distance of unit normals of neighbours that face the same way; shorter ones than 1e-3 have no
    direction."""
    squared = gradients.square().sum(-1)
    eikonal = (torch.sqrt(squared + 1e-24) - 1).square().mean()
    has_direction = squared >= 1e-6
    here, there = (F.normalize(g, dim=1) for g in (gradients[beside], gradients[len(gradients) - len(beside) :]))
    apart = (there - here).square().sum(1)
    counts = (
        weights[beside] * (apart.detach() < 2) * has_direction[beside] * has_direction[len(gradients) - len(beside) :]
    )
    return eikonal, (counts * torch.sqrt(apart + 1e-24)).sum() / counts.sum().clamp(min=1e-8)


def light_prior(texels: Tensor, level_sizes: list[int]) -> Tensor:
    """Student's t costs of the texels' brightness and colour, those of the coarsest level beside their mean."""
    coarsest, *finer = texels.split(level_sizes)
    total = texels.new_zeros(())
    for level in (coarsest - coarsest.mean(0), *finer):
        brightness = level.mean(1, keepdim=True)
        colour = (level - brightness).square().mean(1)
        total = total + (torch.log1p(brightness[:, 0].square() / 0.75) + torch.log1p(colour / 0.12)).mean()
    return total


def quadratic_entropy(x: Tensor) -> Tensor:
    """-log of the mean over all pairs of exp(-|x_i - x_j|^2 / 4)."""
    return -torch.log(torch.exp(-0.25 * (x[:, None] - x[None]).square().sum(-1)).mean())
