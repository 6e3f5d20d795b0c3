//! Prefix sums and sorting, which are exact.

use ppm_vk::internals::gather;
use ppm_vk::internals::gpu::Device;
use ppm_vk::internals::layout::{SCAN_BLOCK, SORT_TILE};
use ppm_vk::internals::random::pcg4d;
use ppm_vk::internals::record::Recording;
use ppm_vk::internals::sizes::SORT_DIGIT_BITS;
use ppm_vk::internals::stage::BufferId;

fn device() -> Device {
    Device::open(None).expect("a Vulkan device")
}

fn random_words(count: usize, seed: u32) -> Vec<u32> {
    (0..count as u32).map(|i| pcg4d([i, seed, 0, 0])[0]).collect()
}

/// Index and values of the first difference.
fn first_difference(found: &[u32], expected: &[u32]) -> Option<(usize, u32, u32)> {
    assert_eq!(found.len(), expected.len());
    let mut pairs = found.iter().zip(expected).enumerate();
    pairs
        .find(|(_, (found, expected))| found != expected)
        .map(|(i, (&found, &expected))| (i, found, expected))
}

fn assert_scans(device: &mut Device, numbers: Vec<u32>) {
    let count = numbers.len() as u32;
    let blocks = count.div_ceil(SCAN_BLOCK);
    device.upload(BufferId::Keys, &numbers).expect("an upload");
    device
        .create(BufferId::ScanSums, u64::from(blocks) * 4)
        .expect("a buffer");
    device.create(BufferId::ScanTotal, 4).expect("a buffer");
    let mut recording = Recording::new();
    gather::scan(BufferId::Keys, count, &mut recording);
    device.run(&recording).expect("a run");

    let mut total = 0u32;
    let before = numbers.iter().map(|&number| {
        let before = total;
        total = total.wrapping_add(number);
        before
    });
    let expected: Vec<u32> = before.collect();
    let found: Vec<u32> = device
        .download(BufferId::Keys, Some(expected.len()))
        .expect("a download");
    let difference = first_difference(&found, &expected);
    assert_eq!(
        difference, None,
        "scan of {count}: (index, found, expected) of the first difference"
    );
    let found: Vec<u32> = device.download(BufferId::ScanTotal, Some(1)).expect("a download");
    assert_eq!(found, [total], "total of {count} numbers");
}

#[test]
fn a_scan_is_exact_for_one_number_around_a_block_and_for_millions() {
    let mut device = device();
    for count in [1, 2, 127, 2047, 2048, 2049, 100_000, 5_000_001] {
        // Below 2⁹, so that the sums stay below 2³².
        assert_scans(
            &mut device,
            random_words(count, 1).iter().map(|word| word >> 23).collect(),
        );
    }
}

#[test]
fn a_scan_wraps_around_at_2_to_the_32() {
    assert_scans(&mut device(), vec![u32::MAX; 5000]);
}

/// Sorts `keys`, with their indices as values, on a device with this `capacity`.
fn assert_sorts(device: &mut Device, case: &str, keys: Vec<u32>, capacity: usize, bits: u32) {
    let count = keys.len();
    let values: Vec<u32> = (0..count as u32).collect();
    let padded = |words: &[u32]| {
        // Entries past the count must be ignored.
        let mut words = words.to_vec();
        words.resize(capacity, 0);
        words
    };
    device.upload(BufferId::Keys, &padded(&keys)).expect("an upload");
    device.upload(BufferId::Values, &padded(&values)).expect("an upload");
    device
        .upload(BufferId::PhotonCount, &[count as u32])
        .expect("an upload");
    let histograms = ((capacity as u32).div_ceil(SORT_TILE) + 1) << SORT_DIGIT_BITS;
    for (id, words) in [
        (BufferId::OtherKeys, capacity as u32),
        (BufferId::OtherValues, capacity as u32),
        (BufferId::Histograms, histograms),
    ] {
        device.create(id, u64::from(words) * 4).expect("a buffer");
    }
    let mut recording = Recording::new();
    let [sorted, _] = gather::sort(
        BufferId::PhotonCount,
        capacity as u32,
        bits,
        gather::PHOTON_PAIRS,
        &mut recording,
    );
    device.run(&recording).expect("a run");

    let mut pairs: Vec<(u32, u32)> = keys.into_iter().zip(values).collect();
    pairs.sort_by_key(|(key, _)| key & (u32::MAX >> (32 - bits)));
    let (expected_keys, expected_values): (Vec<u32>, Vec<u32>) = pairs.into_iter().unzip();
    for (id, expected) in [(sorted.keys, expected_keys), (sorted.values, expected_values)] {
        let found: Vec<u32> = device.download(id, Some(capacity)).expect("a download");
        let difference = first_difference(&found[..count], &expected);
        assert_eq!(
            difference, None,
            "{case}, {bits} bits: (index, found, expected) of the first difference in {id:?}"
        );
    }
}

#[test]
fn a_sort_is_exact_and_stable() {
    let mut device = device();
    let capacity = 20_000;
    // The low 12 bits occur five times each: their values show whether the order of equal keys is kept.
    // In one pass and in several, with digits of all lengths.
    for bits in [1, 4, 5, 8, 9, 12, 20, 22, 32] {
        let mask = u32::MAX >> (32 - bits);
        let random: Vec<u32> = random_words(capacity, bits).iter().map(|word| word & mask).collect();
        let mut sorted = random.clone();
        sorted.sort_unstable();
        let reversed = sorted.iter().rev().copied().collect();
        for (case, keys) in [
            ("random keys", random),
            ("sorted keys", sorted),
            ("reversed keys", reversed),
            ("equal keys", vec![0x5a5a_5a5a & mask; capacity]),
            ("largest keys", vec![mask; capacity]),
        ] {
            assert_sorts(&mut device, case, keys, capacity, bits);
        }
    }
}

#[test]
fn a_sort_takes_any_count_up_to_its_capacity() {
    let mut device = device();
    for count in [0, 1, 2, 15, 16, 17, 2047, 2048, 2049, 4095, 9_999, 10_000] {
        let keys = random_words(count, 7).iter().map(|word| word & 0xffff).collect();
        assert_sorts(&mut device, &format!("{count} of 10,000 keys"), keys, 10_000, 16);
    }
    let keys = random_words(300_001, 8).iter().map(|word| word & 0xffff).collect();
    assert_sorts(&mut device, "300,001 keys", keys, 300_001, 16);
}
